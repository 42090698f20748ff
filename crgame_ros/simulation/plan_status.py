# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The statuses of the simulation about plans and the end of a run, as sim_node publishes them."""

from crgame_ros.messages.status_values import ERROR, OK, Status, WARN
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle


def plans_status(av: AutonomousVehicle, n: int, dt_s: float) -> Status:
    """
    Return the status `sim_node: <av> plans`: its counts, and how well a tracked AV follows.

    :param n: the present step.
    :param dt_s: nominal step [s]
    """
    counters, age, stale = av.counters, av.plan_age_steps(n), av.uses_no_plan
    return Status.of(
        f'sim_node: {av.setup.id} plans', ERROR if stale else OK,
        'no plan: braking' if stale else 'following its plan',
        {'planner': av.setup.spec.planner, 'running': av.planner_running,
         'requests': counters.requests, 'accepted': counters.accepted,
         'refused': counters.refused, 'of_others': counters.of_others,
         'skipped': counters.skipped,
         'timed_out': counters.timed_out, 'realigned': counters.realigned,
         'steps_without_plan': counters.steps_without_plan,
         'latency_ms': round(counters.last_latency_steps * dt_s * 1e3, 3),
         'age_ms': '' if age is None else round(age * dt_s * 1e3, 3),
         'last_refusal': counters.last_refusal, **_tracking(av)})


def refusal_status(av: str, reason: str, n: int) -> Status:
    """Return the status that tells why a plan of an AV was refused at step n."""
    return Status.of(f'sim_node: {av} plan refused', WARN, reason, {'n': n})


def stop_status(vehicle: str, violation_n: int | str, stop_n: int) -> Status:
    """Return the status of the end of a run by a vehicle's violation, at their steps."""
    return Status.of('sim_node: stop', ERROR, f'{vehicle} violates drivability',
                     {'violation_n': violation_n, 'stop_n': stop_n})


def stop_reason(vehicle: str) -> str:
    """Return the reason of such an end, as on `/sim/state`."""
    return f'drivability of {vehicle}'


def _tracking(av: AutonomousVehicle) -> dict[str, object]:
    """Return the present and largest deviations of a tracked AV from its route's lane and plan."""
    execution = av.execution
    if execution is None:
        return {}
    values: dict[str, object] = {}
    lane = av.route_lane
    if lane is not None:
        values['lane_error'] = '' if lane.error is None else round(lane.error, 4)
        values['worst_lane_error'] = round(lane.worst, 4)
    for when, errors in (('', execution.errors), ('worst_', execution.worst)):
        for name in ('lateral', 'along', 'heading', 'speed'):
            value = '' if errors is None else round(getattr(errors, name), 4)
            values[f'{when}{name}_error'] = value
    return values
