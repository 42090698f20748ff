# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page's status and alarms, gathered from the diagnostics of the nodes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
import math
from typing import TypedDict

from crgame_ros.game.events import FiredEvent
from crgame_ros.messages.status_values import BRAKING, Status, status_number, status_truth

OK, ERROR = 0, 2
Violation = TypedDict('Violation', {'vehicle': str, 'with': str, 't': float}, total=False)
Verdict = TypedDict('Verdict', {  # noqa: UP013
    'collision': bool, 'off_road': bool, 'hit': list[str]}, total=False)
# Late traffic is reported at each late tick, and its end is never reported [s].
LATE_TRAFFIC_S = 2.0
# A stopped vehicle that touches the same object again within this time has one contact [s].
SAME_CONTACT_S = 1.0
_WORST, _OF, _THRESHOLD, _EXPOSURE = 'worst_', '_of', 'threshold_', 'exposure_'
TRACKING = tuple(f'{when}{name}_error' for when in ('', 'worst_')
                 for name in ('lane', 'lateral', 'along', 'heading', 'speed'))


@dataclass(frozen=True)
class Alarm:
    """
    An alarm on the page.

    :param kind: collision, off_road, stale_plan, lost_device, recording, late or late_traffic.
    :param subject: vehicle or node concerned.
    :param since_t: time of the run at which it began [s].
    """

    kind: str
    subject: str
    text: str
    since_t: float

    @property
    def id(self) -> str:  # noqa: A003
        """Return the key of the alarm while it lasts."""
        return f'{self.kind}:{self.subject}'


class RunStatus:
    """A collector of the statuses of `/diagnostics` and `/<v>/drivability`."""

    def __init__(self) -> None:
        self.real_time_factor = 1.0
        self.recording: dict[str, object] = {'state': 'none', 'messages': 0, 'megabytes': 0.0,
                                             'text': 'nothing is recorded'}
        # Counts changes of the verdicts, so that a collision is heard when it is seen.
        self.verdicts = 0
        self._alarms: dict[str, Alarm] = {}
        self._rules: dict[str, Callable[..., None]] = {
            'sim_node: run': self._add_run, 'sim_node: traffic': self._add_traffic,
            'timesync_node: table I': self._add_timing,
            'recorder_node: recording': self._add_recording}
        self.begin(())

    def begin(self, vehicles: Sequence[str]) -> None:
        """Start a run with these vehicles."""
        self._vehicles = tuple(vehicles)
        self.run = 'waiting'
        self.reason = ''
        self.stays = False
        self.awaited: list[str] = []
        self.countdown_s = 0
        self.timing: dict[str, object] | None = None
        self.planners: dict[str, dict[str, object]] = {}
        self.drivability: dict[str, Verdict] = {}
        self.criticality: dict[str, dict[str, object]] = {}
        self.seats_lost: dict[str, bool] = {}
        # Devices at the machine of the game, by seat.
        self.devices: dict[str, dict[str, object]] = {}
        self.contacts: list[Violation] = []
        self.departures: list[Violation] = []
        self._stops: dict[FiredEvent, float] = {}
        self._traffic_late_t = -math.inf
        self._calm()

    def _calm(self) -> None:
        """Clear all alarms except that of the recording."""
        self._alarms = {key: alarm for key, alarm in self._alarms.items()
                        if alarm.kind == 'recording'}

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """Return the current alarms, the oldest first."""
        return tuple(self._alarms.values())

    def add(self, status: Status, t: float) -> None:
        """Add a status, named by node and subject or `<v>/drivability`, of a time t [s]."""
        name, level, text, values = status
        if t > self._traffic_late_t + LATE_TRAFFIC_S:
            self._alarm('late_traffic', 'traffic', False, '', t)
        if (rule := self._rules.get(name)) is not None:
            rule(level, text, values, t)
            return
        owner, _, about = name.partition('/')
        node, _, subject = name.partition(': ')
        vehicle, _, rest = subject.partition(' ')
        if owner in self._vehicles and about == 'drivability':
            self._add_drivability(owner, values, t)
        elif vehicle not in self._vehicles:
            return
        elif node == 'sim_node' and rest == 'plans':
            self._add_plans(vehicle, level, text, values, t)
        elif node == 'planner_node':
            # An event may have changed the planner that the game names.
            planner = self._planner(vehicle)
            planner.update(
                planner=values.get('planner', ''),
                plan_time_ms=status_number(values, 'plan_time_ms'),
                fallbacks=status_number(values, 'fallbacks'))
            if text.startswith(BRAKING):
                planner['failure'] = text.removeprefix(BRAKING)
        elif node == 'sim_node' and rest == 'seat':
            self.seats_lost[vehicle] = level != OK
            self._alarm('lost_device', vehicle, level != OK, 'not driven', t)
        elif node == 'criticality_node':
            self.criticality[vehicle] = _criticality(level, values)
        elif node == 'driver_node' and rest == 'driver':
            self.devices[vehicle] = {
                'seat': vehicle, 'device': text, 'command_ms': status_number(values, 'command_ms'),
                'input_delay_ms': status_number(values, 'input_delay_ms')}
        elif node == 'driver_node':
            self._alarm('lost_device', vehicle, level == ERROR, text, t)

    def add_events(self, fired: Sequence[FiredEvent], dt_s: float) -> None:
        """
        Add the contacts that stopped a driver: without overlap, no verdict reports them.

        :param fired: all events since the start of the run.
        :param dt_s: simulation step [s]
        """
        for event in fired:
            if event.touching is None or event in self._stops:
                continue
            vehicle, other = event.touching
            t = self._stops[event] = event.n * dt_s
            # A contact that a verdict already names is not counted again.
            if other not in self._hit(vehicle) and vehicle not in self._hit(other):
                self.contacts.append({'vehicle': vehicle, 'with': other, 't': t})
                self.verdicts += 1

    def lose(self) -> None:
        """Record that the simulation is silent."""
        if self.run != 'ended':
            self.run, self.reason = 'ended', 'silence'
            self._calm()

    def document(self) -> dict[str, object]:
        """Return the part of the status document about the run's health."""
        over = self.run == 'ended'
        return {'run': self.run, 'reason': self.reason, 'stays': self.stays,
                'awaited': self.awaited, 'countdown_s': self.countdown_s,
                'contacts': self.contacts,
                'departures': self.departures,
                'real_time_factor': self.real_time_factor, 'recording': self.recording,
                'timing': self.timing, 'planners': self.planners,
                'drivability': self.drivability, 'criticality': self.criticality,
                'seats_lost': {} if over else self.seats_lost}

    def alarms_document(self) -> dict[str, object]:
        """Return the alarms document."""
        return {'active': [{'id': alarm.id, **asdict(alarm)} for alarm in self.alarms]}

    def _alarm(self, kind: str, subject: str, on: bool, text: str, t: float) -> None:
        alarm = Alarm(kind, subject, text, t)
        # Alarms that last when a run has ended are reported in its result.
        if not on or (self.run == 'ended' and kind != 'recording'):
            self._alarms.pop(alarm.id, None)
        elif alarm.id not in self._alarms or self._alarms[alarm.id].text != text:
            self._alarms[alarm.id] = alarm

    def _planner(self, vehicle: str) -> dict[str, object]:
        return self.planners.setdefault(vehicle, {
            'running': True, 'stale': False, 'latency_ms': None, 'age_ms': None, 'accepted': 0,
            'refused': 0, 'of_others': 0, 'plan_time_ms': None, 'fallbacks': 0, 'planner': '',
            'failure': '', 'last_refusal': '', 'tracking': None})

    def _add_run(self, _: int, text: str, values: Mapping[str, str], __: float) -> None:
        self.run, self.reason = text, values.get('reason', '')
        self.stays = status_truth(values, 'stays')
        if text == 'ended':
            self._calm()
        self.awaited = [item for item in values.get('awaited', '').split(',') if item]
        self.countdown_s = int(status_number(values, 'countdown_s') or 0)
        self.real_time_factor = status_number(values, 'real_time_factor') or 1.0

    def _add_traffic(self, level: int, text: str, _: Mapping[str, str], t: float) -> None:
        if level != OK:
            self._traffic_late_t = t
            self._alarm('late_traffic', 'traffic', True, text, t)

    def _add_timing(self, _: int, __: str, values: Mapping[str, str], t: float) -> None:
        self.timing = {key: status_number(values, key) for key in values
                       if key not in ('frame_skipping', 'worst_late_step')}
        if 'worst_late_step' in values:
            self.timing['worst_late_step'] = values['worst_late_step']
        skipping = status_truth(values, 'frame_skipping')
        self.timing['frame_skipping'] = skipping
        self._alarm('late', 'simulation', skipping, 'late: frames are skipped', t)

    def _add_recording(self, level: int, text: str, values: Mapping[str, str], t: float) -> None:
        failed = level == ERROR
        megabytes = (status_number(values, 'bytes') or 0.0) / 1e6
        self.recording = {
            'state': 'failed' if failed else
            'recorded' if status_truth(values, 'closed') else 'recording', 'text': text,
            'messages': int(status_number(values, 'messages') or 0), 'megabytes': megabytes}
        self._alarm('recording', 'recorder', failed, text, t)

    def _add_drivability(self, vehicle: str, values: Mapping[str, str], t: float) -> None:
        collision = status_truth(values, 'collision')
        off_road = values.get('road_compliance') == 'false'
        hit = [item for item in values.get('hit', '').split(',') if item]
        self._note_violations(vehicle, hit, off_road, t)
        verdict: Verdict = {'collision': collision, 'off_road': off_road, 'hit': hit}
        self.verdicts += verdict != self.drivability.get(vehicle)
        self.drivability[vehicle] = verdict
        self._alarm('collision', vehicle, collision, 'collision with ' + ', '.join(hit), t)
        self._alarm('off_road', vehicle, off_road, 'off the road', t)

    def _note_violations(self, vehicle: str, hit: Sequence[str], off_road: bool, t: float) -> None:
        """Record the violations of a verdict that the one before did not have."""
        for other in hit:
            # Both of two driven vehicles report their contact.
            told = vehicle in self._hit(other) or self._was_stopped(vehicle, other, t)
            if other not in self._hit(vehicle) and not told:
                self.contacts.append({'vehicle': vehicle, 'with': other, 't': t})
        if off_road and not self.drivability.get(vehicle, {}).get('off_road'):
            self.departures.append({'vehicle': vehicle, 't': t})

    def _hit(self, vehicle: str) -> Sequence[str]:
        """Return the objects that the last verdict on a vehicle names."""
        return self.drivability.get(vehicle, {}).get('hit', ())

    def _was_stopped(self, vehicle: str, other: str, t: float) -> bool:
        """Return whether one of two vehicles has just been stopped by a contact with the other."""
        return any({*(event.touching or ())} == {vehicle, other}
                   and abs(t - at_t) < SAME_CONTACT_S for event, at_t in self._stops.items())

    def _add_plans(self, vehicle: str, level: int, text: str, values: Mapping[str, str],
                   t: float) -> None:
        self._planner(vehicle).update(
            running=status_truth(values, 'running', True), stale=level == ERROR,
            latency_ms=status_number(values, 'latency_ms'), age_ms=status_number(values, 'age_ms'),
            accepted=int(status_number(values, 'accepted') or 0),
            refused=int(status_number(values, 'refused') or 0),
            of_others=int(status_number(values, 'of_others') or 0),
            planner=self._planner(vehicle)['planner'] or values.get('planner', ''),
            last_refusal=values.get('last_refusal', ''), tracking=_tracking(values))
        self._alarm('stale_plan', vehicle, level == ERROR, text, t)


def _tracking(values: Mapping[str, str]) -> dict[str, float | None] | None:
    """Return an AV's deviation from its plan, now and at worst; None unless it tracks plans."""
    if TRACKING[0] not in values:
        return None
    return {name: status_number(values, name) for name in TRACKING}


def _criticality(level: int, values: Mapping[str, str]) -> dict[str, object]:
    """Read a vehicle's criticality: the worst values so far and their limits."""
    worst = {name[len(_WORST):-len(_OF)]: other for name, other in values.items()
             if name.startswith(_WORST) and name.endswith(_OF)}
    return {'critical': level != OK,
            'exposures': {name.removeprefix(_EXPOSURE): status_number(values, name)
                          for name in values if name.startswith(_EXPOSURE)},
            'worst': {name: {'value': status_number(values, f'{_WORST}{name}'), 'of': other,
                             't': status_number(values, f'{_WORST}{name}_at')}
                      for name, other in worst.items()},
            'thresholds': {name.removeprefix(_THRESHOLD): status_number(values, name)
                           for name in values if name.startswith(_THRESHOLD)}}
