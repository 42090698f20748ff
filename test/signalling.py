# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded priority vehicle with signals, to add to a scenario of a straight road."""

# Elements that are on from each of these time steps on.
SIGNALS = {0: ('indicatorLeft',), 4: ('hazardWarningLights', 'flashingBlueLights'),
           5: ('brakingLights', 'flashingBlueLights'), 12: ('horn', 'indicatorRight'), 15: ()}
# The same as bits of `Light`.
BITS = {0: 1, 4: 3 + 16, 5: 8 + 16, 12: 4 + 2, 15: 0}


def expected_bits(k: int) -> int:
    """Return the bits of `Light` that it shows at a time step."""
    return BITS[max(step for step in BITS if step <= k)]


def signalling_vehicle(number: int, y: float, last: int = 40) -> str:
    """
    Return the XML of a vehicle at 10 m/s.

    :param number: its id.
    :param y: of its straight course [m]
    :param last: time step of its last state.
    """
    states = [f'<position><point><x>{k}</x><y>{y}</y></point></position><orientation><exact>0'
              f'</exact></orientation><time><exact>{k}</exact></time><velocity><exact>10</exact>'
              '</velocity>' for k in range(last + 1)]
    first, *later = [f'<time><exact>{k}</exact></time>' + ''.join(
        f'<{name}>true</{name}>' for name in on) for k, on in SIGNALS.items()]
    return (f'<dynamicObstacle id="{number}"><type>priorityVehicle</type><shape><rectangle>'
            '<length>4.8</length><width>2</width></rectangle></shape>'
            f'<initialState>{states[0]}</initialState><initialSignalState>{first}'
            '</initialSignalState><trajectory>'
            + ''.join(f'<state>{state}</state>' for state in states[1:]) + '</trajectory>'
            '<signalSeries>' + ''.join(f'<signalState>{state}</signalState>' for state in later)
            + '</signalSeries></dynamicObstacle>')
