# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Networks of SUMO and OpenStreetMap extracts as OpenDRIVE, by SUMO's netconvert."""

from collections.abc import Callable
from pathlib import Path

from crgame_ros.errors import CrgameError
from crgame_ros.worlds.environments import run_converter, SUMO_TOOLS
from lxml import etree

# SUMO's letters for the states of a light (its documentation, Simulation/Traffic_Lights).
_COLOURS = {'G': 'green', 'g': 'green', 's': 'green', 'y': 'yellow', 'Y': 'yellow', 'r': 'red',
            'u': 'redYellow', 'o': 'inactive', 'O': 'inactive'}
# As SUMO's documentation recommends for OpenStreetMap (Networks/Import/OpenStreetMap).
_OSM_OPTIONS = ('--geometry.remove', '--ramps.guess', '--junctions.join', '--roundabouts.guess',
                '--tls.guess-signals', '--tls.discard-simple', '--tls.join',
                '--tls.default-type', 'static', '--keep-edges.by-vclass', 'passenger',
                '--remove-edges.isolated', '--output.street-names')
# Nobody turns round on the spot, and limits are those of the roads in turns as well.
_OPTIONS = ('--no-turnarounds', '--junctions.limit-turn-speed', '-1')
# The cycle of a light: durations [s] and colours of CommonRoad.
LightCycle = list[tuple[float, str]]


def to_opendrive(source: Path, is_osm: bool, folder: Path, timeout_s: float,
                 say: Callable[[str], object]) -> Path:
    """
    Convert a network or an extract to OpenDRIVE.

    :param source: the file; of a network the turns on the spot have to be gone already.
    :param folder: for the files; it gets `map.xodr` and `map.net.xml`.
    :param say: called with a line if SUMO's programs have to be installed.
    :return: the OpenDRIVE file.
    :raises InputError: if netconvert cannot read the file.
    """
    program = SUMO_TOOLS.program('netconvert', say)
    given = ['--osm-files', str(source), *_OSM_OPTIONS] if is_osm else ['-s', str(source)]
    if is_osm:
        types = next(program.parent.parent.glob('lib/*/site-packages/**/typemap/osmNetconvert.typ'
                                                '.xml'), None)
        if types is None:
            raise CrgameError(f'{program}: has no osmNetconvert.typ.xml; remove its environment')
        given += ['--type-files', str(types)]
    out = folder / 'map.xodr'
    run_converter([str(program), *given, *_OPTIONS, '--opendrive-output', str(out),
                   '--output-file', str(folder / 'map.net.xml')], folder,
                  f'{source}: netconvert', timeout_s)
    return out


def without_turns(network: etree._Element) -> etree._Element:
    """Return a network without its links for turning round on the spot, as at each junction."""
    for connection in list(network.iterchildren('connection')):
        if connection.get('dir') == 't':
            network.remove(connection)
    return network


def light_cycles(opendrive: etree._Element, network: etree._Element) -> list[LightCycle | None]:
    """
    Return the program of each light, which SUMO's OpenDRIVE leaves out.

    :param opendrive: the map as netconvert wrote it: its signals are named JUNCTION_LINK.
    :param network: the network, with the programs.
    :return: of the dynamic signals in the order of the map; None without a program.
    """
    programs: dict[str | None, list[tuple[float, str]]] = {}
    for logic in network.iterchildren('tlLogic'):
        # The first program of a junction runs.
        programs.setdefault(logic.get('id'), [
            (float(phase.get('duration')), phase.get('state')) for phase in logic.iter('phase')])
    return [_cycle(programs, signal.get('id') or '') for signal in opendrive.iter('signal')
            if signal.get('dynamic') == 'yes']


def _cycle(programs: dict[str | None, list[tuple[float, str]]], name: str) -> LightCycle | None:
    junction, _, link = name.rpartition('_')
    phases = programs.get(junction)
    if not phases or not link.isdecimal() or int(link) >= min(len(s) for _, s in phases):
        return None
    cycle: LightCycle = []
    for duration, states in phases:
        colour = _COLOURS.get(states[int(link)], 'inactive')
        if cycle and cycle[-1][1] == colour:
            cycle[-1] = (cycle[-1][0] + duration, colour)
        else:
            cycle.append((duration, colour))
    return cycle
