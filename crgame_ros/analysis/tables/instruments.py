# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of other instruments: channels, samples, gaze, glances and their sums."""

from collections.abc import Mapping
from functools import partial
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
from crgame_ros.roads.surface import lanelet_areas
from crgame_ros.scenario.loading import parse_scenario
import numpy as np
import shapely

_STREAM = Column('stream', TEXT, '', 'its name, with the id of its device where two have the same')
_CHANNEL = Column('channel', TEXT, '', 'name of the channel', variant='with # and its place, from '
                  '1, where two of the stream have the same')
_UNMEASURED = 'LSL has not measured the clock of its sender'
INSTRUMENT_CHANNELS = TableDeclaration(
    'instrument_channels', 'a channel of a stream of another instrument',
    ('run', 'stream', 'channel'), (
        RUN, _STREAM, _CHANNEL,
        Column('unit', TEXT, '', 'of its values, as its program names it',
               empty='its program names none'),
        Column('type', TEXT, '', 'kind of content of the stream', empty='its program names none'),
        Column('source_id', TEXT, '', 'of the device', empty='its program names none'),
        Column('host', TEXT, '', 'machine that sent it', empty='its program names none'),
        Column('rate', NUMBER, 'Hz', 'nominal rate of the stream', empty='it is irregular'),
        Column('samples', INTEGER, '1', 'samples of the stream in this run'),
        Column('gaps', INTEGER, '1', 'how often its program was gone and came back, since the '
               'instruments were started'),
        Column('clock_drift', NUMBER, '1', 'by how much the clock of its sender runs faster than '
               'that of this machine', variant='line of least squares through the offsets that '
               'LSL has measured; of the longest connection', empty='there are fewer than three')))
INSTRUMENT_SAMPLES = TableDeclaration(
    'instrument_samples', 'a value of a channel of another instrument',
    ('run', 'stream', 'number', 'channel'), (
        RUN, _STREAM,
        Column('number', INTEGER, '1', 'counts the samples of the stream from 0, in the order of '
               'arrival'),
        _CHANNEL,
        Column('time_s', NUMBER, 's', "when it was, on the run's clock", variant='simulated time '
               'between the starts of two cycles, on the straight line between them; before the '
               'first (negative) and after the last as real time', empty=_UNMEASURED),
        Column('value', NUMBER, '1', 'the number', variant='in the unit of its channel, which '
               'instrument_channels names', empty='it is a text, or its program sent NaN'),
        Column('text', TEXT, '', 'the text', empty='it is a number'),
        Column('steady_s', NUMBER, 's', 'when it was, on the steady clock of this machine',
               variant='as stamped, plus the offset that LSL has measured, on the straight line '
               'between two measurements', empty=_UNMEASURED),
        Column('sent_s', NUMBER, 's', "as stamped, on the sender's clock"),
        Column('uncertainty_s', NUMBER, 's', 'of the offset between the two clocks',
               variant='round trip of the measurement that was the newest at the arrival',
               empty='none was made yet')))
INSTRUMENT_TABLES = INSTRUMENT_CHANNELS, INSTRUMENT_SAMPLES
_AREAS = (*get_args(ShownKind), ROAD, SURROUNDINGS, OFF_VIEW)
_OF = (RUN, Column('vehicle', TEXT, '', 'id of the vehicle whose driver it is'),
       Column('stream', TEXT, '', 'of the gaze, as in instrument_channels'))
_NO_PLACE = 'it is lost, or unknown'
GAZE = TableDeclaration(
    'gaze', "a sample of a driver's gaze", ('run', 'vehicle', 'stream', 'number'),
    (*_OF,
     Column('number', INTEGER, '1', 'number of the sample in instrument_samples'),
     Column('time_s', NUMBER, 's', "when it was, on the run's clock",
            variant='as in instrument_samples', empty=_UNMEASURED),
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


def write_instruments(run: Run, writers: Mapping[str, TableRows]) -> None:
    """
    Add the rows of a run to the tables of instruments.

    :raises InputError: if the recording cannot be read.
    """
    for recorded in run.streams:
        channels = _distinct(recorded.stream.channels)
        _add_channels(run, recorded, channels, writers[INSTRUMENT_CHANNELS.name])
        _add_samples(run, recorded, channels, writers[INSTRUMENT_SAMPLES.name])


def _distinct(names: tuple[str, ...]) -> list[str]:
    return [f'{name}#{place}' if names.count(name) > 1 else name
            for place, name in enumerate(names, 1)]


def _add_channels(run: Run, recorded: RecordedStream, channels: list[str],
                  writer: TableRows) -> None:
    stream = recorded.stream
    writer.add({
        'run': run.id, 'stream': recorded.id, 'channel': channels, 'unit': list(stream.units),
        'type': stream.type, 'source_id': stream.source_id, 'host': stream.host,
        'rate': stream.rate_hz or None, 'samples': len(recorded.sent_s), 'gaps': stream.gaps,
        'clock_drift': recorded.drift})


def _add_samples(run: Run, recorded: RecordedStream, channels: list[str],
                 writer: TableRows) -> None:
    """Add all values of a sample one after the other, in pieces."""
    width, count = len(channels), len(recorded.sent_s)
    step = max(1, PIECE_ROWS // max(width, 1))
    for start in range(0, count, step):
        part = slice(start, min(start + step, count))
        rows = part.stop - start
        values: dict[str, object] = {'value': recorded.values[part].ravel()} \
            if not recorded.texts else {
                'text': [text for row in recorded.texts[part] for text in row]}
        writer.add({
            'run': run.id, 'stream': recorded.id,
            'number': np.repeat(np.arange(start, part.stop), width), 'channel': channels * rows,
            **{name: np.repeat(column[part], width) for name, column in (
                ('time_s', recorded.times_s), ('steady_s', recorded.steady_s),
                ('sent_s', recorded.sent_s), ('uncertainty_s', recorded.uncertainty_s))},
            **values})


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
        _add_gaze(same, recorded, samples, found, writers[GAZE.name])
        _add_glances(same, recorded, found, writers)


def _samples(spec: GazeSpec, recorded: RecordedStream) -> GazeSamples:
    channels = recorded.stream.channels
    x, y = (recorded.values[:, channels.index(name)] for name in (spec.x, spec.y))
    confidence = None if spec.confidence is None \
        else recorded.values[:, channels.index(spec.confidence)]
    return GazeSamples(recorded.steady_s, x, y, confidence)


def _add_gaze(same: Mapping[str, object], recorded: RecordedStream, samples: GazeSamples,
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
    known = np.flatnonzero(np.isfinite(recorded.steady_s))
    known = known[np.argsort(recorded.steady_s[known], kind='stable')]
    in_run_s = partial(np.interp, xp=recorded.steady_s[known], fp=recorded.times_s[known])
    writers[GLANCES.name].add_rows({
        **same, **each.area._asdict(), 'number': number, 'time_s': in_run_s(each.start_s),
        'duration_s': each.duration_s, 'transition_s': each.transition_s, 'dwell_s': each.dwell_s}
        for number, each in enumerate(made))
    writers[GLANCE_SUMS.name].add_rows({
        **same, **each._asdict(), 'object': each.object or 'all',
        'first_s': in_run_s(each.first_s)} for each in glance_sums(made))
