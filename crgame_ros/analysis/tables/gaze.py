# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of gaze: what each sample is on, glances, and their sums."""

from collections.abc import Mapping
from typing import get_args

from crgame_ros.analysis.behaviour.gaze import (
    GazeSamples,
    glance_sums,
    glances,
    LONGEST_GAP_S,
    looked_at,
    LookedAt,
    LOST,
    OFF_VIEW,
    ROAD,
    SHORTEST_S,
    SURROUNDINGS,
    TOLERANCE_S,
    UNKNOWN,
)
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    Column,
    INTEGER,
    NUMBER,
    RUN,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.writer import PIECE_ROWS, TableRows
from crgame_ros.game.instruments_spec import GazeSpec
from crgame_ros.game.view_documents import ShownKind
from crgame_ros.recording.instrument_streams import RecordedStream
from crgame_ros.recording.views import read_pictures
from crgame_ros.roads.boundary import lanelet_areas
from crgame_ros.scenario.loading import parse_scenario
import numpy as np
from numpy.typing import NDArray
import shapely

_AREAS = (*get_args(ShownKind), ROAD, SURROUNDINGS, OFF_VIEW)
_OF = (RUN, Column('vehicle', TEXT, '', 'id of the vehicle whose driver it is'),
       Column('stream', TEXT, '', 'of the gaze, as in instrument_channels'))
_NO_PLACE = 'it is lost, or unknown'
GAZE = TableDeclaration(
    'gaze', "a sample of a driver's gaze", ('run', 'vehicle', 'stream', 'number'),
    (*_OF,
     Column('number', INTEGER, '1', 'number of the sample in instrument_samples'),
     Column('time_s', NUMBER, 's', "when it was, on the run's clock",
            variant='as in instrument_samples', empty='LSL has not measured the clock of its '
            'sender'),
     Column('x', NUMBER, '1', "from the left edge of the 3D view, in shares of the view's width",
            empty=_NO_PLACE),
     Column('y', NUMBER, '1', "from the upper edge, in shares of the view's height",
            empty=_NO_PLACE),
     Column('kind', TEXT, '', 'what the gaze is on',
            variant=f'{ROAD}: a lanelet, without anything before it; {SURROUNDINGS}: all else in '
            f'the view; {OFF_VIEW}: beside it; {LOST}: the device knows no gaze; {UNKNOWN}: no '
            f'picture of the view within {TOLERANCE_S:g} s', values=(*_AREAS, LOST, UNKNOWN)),
     Column('object', TEXT, '', 'id of the vehicle or object, of the sign or traffic light in the '
            'map, or name of mirror, instrument or task',
            variant='the foremost whose box contains the gaze; without any, the nearest within '
            'the margin', empty='it is on none'),
     Column('in_mirror', TEXT, '', 'id of the vehicle or object that is seen there in the mirror',
            empty='it is on no mirror, or on nothing in it'),
     Column('distance_m', NUMBER, 'm', 'from the eye to the nearest point of the object, of what '
            'is seen in the mirror, or to the point on the road', empty='it is on none of these'),
     Column('between_s', NUMBER, 's', 'from the sample to the nearest picture of the view',
            empty='no picture was recorded'),
     Column('confidence', NUMBER, '1', 'of the device', 'as it tells it',
            empty='the game names no channel of it')))
_GLANCE = 'transition and dwell (ISO 15007), on the steady clock: of the person, not of the run'
GLANCES = TableDeclaration(
    'glances', 'a glance of a driver at an area of interest',
    ('run', 'vehicle', 'stream', 'number'),
    (*_OF, Column('number', INTEGER, '1', 'counts the glances from 0'),
     Column('time_s', NUMBER, 's', "begin of the transition, on the run's clock"),
     Column('kind', TEXT, '', 'what is looked at, as in gaze', values=_AREAS),
     Column('object', TEXT, '', 'which, as in gaze; road, surroundings and off_view are one area '
            'each'),
     Column('duration_s', NUMBER, 's', 'of the glance', variant=_GLANCE),
     Column('transition_s', NUMBER, 's', 'from the end of the dwell before to the first sample on '
            'the area', variant=f'0 where it is more than {LONGEST_GAP_S:g} s'),
     Column('dwell_s', NUMBER, 's', 'from the first sample on the area to the first beside it',
            variant=f'{SHORTEST_S:g} s or more: what is shorter is part of a transition; up to '
            f'{LONGEST_GAP_S:g} s without a known gaze, or with what is shorter, do not end it')))
GLANCE_SUMS = TableDeclaration(
    'glance_sums', 'an area of interest, or a kind of them, at which a driver glanced',
    ('run', 'vehicle', 'stream', 'kind', 'object'),
    (*_OF, Column('kind', TEXT, '', 'of areas, as in gaze', values=_AREAS),
     Column('object', TEXT, '', 'which, as in glances', variant='all: the sum of the kind'),
     Column('glances', INTEGER, '1', 'their number'),
     Column('total_s', NUMBER, 's', 'total glance duration', variant=_GLANCE),
     Column('mean_s', NUMBER, 's', 'mean glance duration', variant=_GLANCE),
     Column('longest_s', NUMBER, 's', 'longest glance', variant=_GLANCE),
     Column('share', NUMBER, '1', 'of the time of all glances'),
     Column('first_s', NUMBER, 's', "begin of the first, on the run's clock")))
GAZE_TABLES = GAZE, GLANCES, GLANCE_SUMS


def write_gaze(run: Run, writers: Mapping[str, TableRows]) -> None:
    """
    Add the rows of a run to the tables of gaze.

    :raises InputError: if the recording cannot be read.
    """
    specs = () if run.game.instruments is None else run.game.instruments.gaze
    streams = [(spec, recorded) for spec in specs for recorded in run.streams
               if recorded.stream.name == spec.stream
               and spec.channels <= set(recorded.stream.channels) and not recorded.texts]
    if run.bag is None or not streams:
        return
    pictures = read_pictures(run.bag, run.game.epoch)
    network = parse_scenario(run.log.xml_text, '/scenario/xml').scenario.lanelet_network
    road = shapely.union_all(lanelet_areas(network.lanelets))
    shapely.prepare(road)
    for spec, recorded in streams:
        samples = _samples(spec, recorded)
        found = looked_at(samples, pictures.get(spec.seat or ''), spec, road)
        same = {'run': run.id, 'vehicle': spec.seat, 'stream': recorded.id}
        _add_samples(same, recorded, samples, found, writers[GAZE.name])
        _add_glances(same, recorded, found, writers)


def _samples(spec: GazeSpec, recorded: RecordedStream) -> GazeSamples:
    channels = recorded.stream.channels
    x, y = (recorded.values[:, channels.index(name)] for name in (spec.x, spec.y))
    confidence = None if spec.confidence is None \
        else recorded.values[:, channels.index(spec.confidence)]
    return GazeSamples(recorded.steady_s, x, y, confidence)


def _add_samples(same: Mapping[str, object], recorded: RecordedStream, samples: GazeSamples,
                 found: LookedAt, writer: TableRows) -> None:
    count = len(recorded.times_s)
    for start in range(0, count, PIECE_ROWS):
        part = slice(start, min(start + PIECE_ROWS, count))
        writer.add({
            **same, 'number': range(part.start, part.stop), 'time_s': recorded.times_s[part],
            **{name: column[part] for name, column in found._asdict().items()},
            **({} if samples.confidence is None else {'confidence': samples.confidence[part]})})


def _add_glances(same: Mapping[str, object], recorded: RecordedStream, found: LookedAt,
                 writers: Mapping[str, TableRows]) -> None:
    made = glances(recorded.steady_s, found)
    if not made:
        return
    known = np.flatnonzero(np.isfinite(recorded.steady_s))
    known = known[np.argsort(recorded.steady_s[known], kind='stable')]

    def in_run_s(steady_s: list[float]) -> NDArray[np.float64]:
        return np.interp(steady_s, recorded.steady_s[known], recorded.times_s[known])
    writers[GLANCES.name].add({
        **same, 'number': range(len(made)), 'time_s': in_run_s([each.start_s for each in made]),
        'kind': [each.area.kind for each in made], 'object': [each.area.object for each in made],
        'duration_s': [each.duration_s for each in made],
        'transition_s': [each.transition_s for each in made],
        'dwell_s': [each.dwell_s for each in made]})
    sums = glance_sums(made)
    names = ('kind', 'glances', 'total_s', 'mean_s', 'longest_s', 'share')
    writers[GLANCE_SUMS.name].add({
        **same, 'object': [each.object or 'all' for each in sums],
        'first_s': in_run_s([each.first_s for each in sums]),
        **{name: [getattr(each, name) for each in sums] for name in names}})
