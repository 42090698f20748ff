# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Summaries of evaluations, against numbers from another computation."""

from collections.abc import Sequence
import math
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.evaluation.results.cell_rows import FACTORS
from crgame_ros.evaluation.summary.cell_block import CellBlocks, EvaluatedParts
from crgame_ros.evaluation.summary.measures import better_of, MEASURES
from crgame_ros.evaluation.summary.summarise import summarise
from crgame_ros.evaluation.summary.summary import Estimate, Summary
from crgame_ros.evaluation.summary.tables import summary_tables
from evaluation_rows import Evaluation, many
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest


def _of(summary: Summary, measure: str, *labels: str, difference: bool = False) -> Estimate:
    place = [each.name for each in summary.measures].index(measure)
    groups: Sequence = summary.differences if difference else summary.groups
    return next(group.estimates[place] for group in groups if group.labels == labels)


@pytest.fixture
def two(tmp_path: Path) -> Summary:
    """Two planners in four scenarios with two seeds, three cells of which failed."""
    found = Evaluation()
    for number in range(8):
        factors = {'scenario': f'ZAM_S-{number % 4}_1_T-1', 'seed': number // 4}
        found.add(planner='idm', avs=[{'worst_ttc': 2.0, 'collided': False}],
                  hv={'worst_ttc': 0.1, 'collided': True},
                  status='died' if number == 7 else 'ok', reason='killed' if number == 7 else '',
                  **factors)
        if number == 6:
            continue
        ended = {0: 'error', 1: 'timeout'}.get(number, 'ok')
        found.add(planner='mine', status=ended, reason='no path' if number == 0 else '',
                  traceback='Traceback: no path' if number == 0 else '',
                  avs=[{'worst_ttc': None if number == 2 else 2.0 + number,
                        'collided': number == 3},
                       {'worst_ttc': 4.0 + number, 'collided': False}], **factors)
    found.add(planner='mine', scenario='ZAM_Other-1_1_T-1',
              avs=[{'worst_ttc': 1.5, 'collided': True}])
    return summarise(found.write(tmp_path / 'two', 3, 1))


def test_means_are_those_of_cells_that_ended_well(two: Summary) -> None:
    # idm: cells 0 to 6. mine: cells 2, 3, 4, 5, 7 and the other one, two AVs each but the last.
    assert (two.cells, two.failed, two.scenarios, two.baseline) == (16, 3, 5, 'idm')
    assert [(group.labels, group.cells, group.failed) for group in two.groups] == [
        (('idm',), 8, 1), (('mine',), 8, 2)]
    assert _of(two, 'worst_ttc', 'idm').value == 2.0
    assert _of(two, 'worst_ttc', 'idm').n == 7
    # Cells: 6 of the second AV of cell 2, the means of both AVs, and that of the only AV.
    # Scenarios: those of cells 4, 5, 2, of 3 and 7 together, and the other one.
    mine = _of(two, 'worst_ttc', 'mine')
    assert mine.n == 6 and mine.value == pytest.approx(np.mean([7.0, 8.0, 6.0, 8.0, 1.5]))
    # Collisions: one of the two AVs of cell 3, and the AV of the other one.
    assert _of(two, 'collision', 'mine').value == pytest.approx((0.25 + 1.0) / 5.0)
    assert _of(two, 'critical_ttc', 'mine').value == pytest.approx(1.0 / 5.0)
    assert _of(two, 'critical_ttc', 'idm').value == 1.0
    failed = _of(two, 'failed', 'mine')
    # 0 and 1 failed: each is one of two cells of its scenario.
    assert (failed.value, failed.n) == (pytest.approx(1.0 / 5.0), 8)


def test_pairs_are_cells_alike_in_all_but_the_planner(two: Summary) -> None:
    found, = two.differences
    assert found.labels == ('mine',)
    # Both ended well: 2, 3, 4, 5. Alone failed: 0 and 1, the baseline 7. Of the other: none.
    assert (found.pairs, found.failed, found.baseline_failed, found.both_failed,
            found.unpaired) == (4, 2, 1, 0, 1)
    # Of cell 2 the mean is that of its second AV: 6; of 3, 4, 5 it is 3 + number.
    ttc = _of(two, 'worst_ttc', 'mine', difference=True)
    assert (ttc.value, ttc.n) == (pytest.approx(np.mean([6.0, 6.0, 7.0, 8.0]) - 2.0), 4)
    # Cell 3: one of its two AVs had a contact.
    assert _of(two, 'collision', 'mine', difference=True).value == pytest.approx(0.5 / 4.0)
    failed = _of(two, 'failed', 'mine', difference=True)
    # Of 0 and 4, of 1 and 5, of 2, and of 3 and 7.
    assert (failed.value, failed.n) == (pytest.approx((0.5 + 0.5 + 0.0 - 0.5) / 4.0), 7)


def test_only_cells_that_are_alike_are_pairs(tmp_path: Path) -> None:
    """Each factor for itself keeps cells apart, whichever comes first."""
    rows = Evaluation()
    rows.add(planner='idm', avs=[{'distance': 1.0}])
    rows.add(planner='mine', avs=[{'distance': 3.0}])
    for number in range(5):
        for factor in ('scenario', 'game', 'human', 'perception', 'traffic'):
            rows.add(planner='mine', avs=[{'distance': 99.0}], **{factor: f'other {number}'})
        rows.add(planner='mine', avs=[{'distance': 99.0}], seed=1 + number)
    found, = summarise(rows.write(tmp_path / 'rows')).differences
    assert (found.pairs, found.unpaired) == (1, 30)
    assert found.estimates[-1].value == 2.0


def test_the_worst_cells_come_contacts_first(two: Summary) -> None:
    planner = FACTORS.index('planner')
    assert [(cell.values, cell.factors[planner], cell.vehicle) for cell in two.worst[:3]] == [
        ((1.0, 1.5), 'mine', 'av0'), ((1.0, 5.0), 'mine', 'av0'), ((0.0, 2.0), 'idm', 'av0')]
    assert len(two.worst) == 10 and len({cell.key for cell in two.worst}) == 10
    # A failed cell is not among them.
    assert all(cell.values[1] == 2.0 for cell in two.worst[2:9])


def test_failures_are_counted_by_their_reason(two: Summary) -> None:
    told = {(each.status, each.reason): each for each in two.failures}
    assert set(told) == {('error', 'no path'), ('timeout', ''), ('died', 'killed')}
    error = told['error', 'no path']
    assert error.cells == ((('mine',), 1),) and error.traceback == 'Traceback: no path'


def test_scenarios_vary_by_chance_or_the_runs_of_a_single_one(tmp_path: Path,
                                                              two: Summary) -> None:
    # idm is in four scenarios, mine in five, their pairs in four.
    assert {group.clustered for group in (*two.groups, *two.differences)} == {'scenarios'}
    assert _of(two, 'worst_ttc', 'idm').clusters == 4
    rows = Evaluation()
    for seed in range(8):
        for planner, distance in (('idm', 1.0), ('mine', 2.0 + seed // 4)):
            rows.add(planner=planner, seed=seed, avs=[{'distance': distance}])
            rows.cells[-1]['state_hash'] = f'{planner} {distance}'
    found = summarise(rows.write(tmp_path / 'rows'))
    assert [(group.clustered, group.runs, group.cells) for group in found.groups] == [
        ('runs', 1, 8), ('runs', 2, 8)]
    one, several = (_of(found, 'distance', planner) for planner in ('idm', 'mine'))
    assert (one.clusters, several.clusters) == (1, 2) and math.isnan(one.low)
    assert found.differences[0].runs == 2
    assert _of(found, 'distance', 'mine', difference=True).clusters == 2


@pytest.mark.parametrize('scenarios, clustered', [
    (1, 'participants'), (4, 'scenarios and participants')])
def test_participants_vary_by_chance_too(tmp_path: Path, scenarios: int, clustered: str) -> None:
    """Three participants with six runs each: their means differ more than the runs of each."""
    rows = Evaluation()
    for run in range(18):
        rows.add(scenario=f'ZAM_S-{run % scenarios}_1_T-1', human=f'run {run}',
                 participant=f'P{run % 3}', avs=[{'distance': 10.0 * (run % 3) + 0.1 * run}])
    found = summarise(rows.write(tmp_path / 'rows'))
    group, = found.groups
    assert (group.clustered, group.participants, group.scenarios, group.runs) == (
        clustered, 3, scenarios, 18)
    distance = _of(found, 'distance', 'idm')
    # Of the participants' means, 0.75, 10.85 and 20.95, it would be 25 m to each side.
    assert distance.high - distance.low > 40.0
    assert distance.clusters == (3 if scenarios == 1 else scenarios)
    assert 'participants' in next(summary_tables(found)).notes[1]


def test_a_difference_of_means_is_the_mean_of_differences(tmp_path: Path) -> None:
    """Where both have the same cells: the weights are the same everywhere."""
    rows = Evaluation()
    for number in range(12):
        for planner in ('idm', 'mine'):
            rows.add(planner=planner, scenario=f'ZAM_S-{number % 3}_1_T-1', seed=number, avs=[
                {'mean_speed': 10.0 + number * each + (planner == 'mine')}
                for each in range(1 + number % 4)])
    found = summarise(rows.write(tmp_path / 'rows'), measures=['mean_speed'])
    mine, idm = (_of(found, 'mean_speed', planner).value for planner in ('mine', 'idm'))
    assert _of(found, 'mean_speed', 'mine', difference=True).value == pytest.approx(mine - idm)


@pytest.mark.slow
@pytest.mark.parametrize('scenarios', [3, 12])
def test_neither_order_nor_parts_matter(tmp_path: Path, scenarios: int) -> None:
    """For any part and place of a row the summary is the same to the last bit."""
    rows = many(240, scenarios)
    found = [summarise(rows.write(tmp_path / str(seed), parts, seed),
                       block_cells=60).as_dict() for seed, parts in ((1, 1), (2, 7), (3, 40))]
    for each in found:
        each.pop('folder')
    assert found[0] == found[1] == found[2]


def test_blocks_change_nothing(tmp_path: Path) -> None:
    """Four blocks are as one, to rounding."""
    folder = many(240, 12).write(tmp_path / 'rows')
    whole, parted = (summarise(folder, block_cells=cells) for cells in (1000, 60))
    for one, other in zip((*whole.groups, *whole.differences),
                          (*parted.groups, *parted.differences), strict=True):
        for left, right in zip(one.estimates, other.estimates, strict=True):
            assert vars(left) == pytest.approx(vars(right), rel=1e-9, nan_ok=True)
    assert whole.worst == parted.worst and whole.failures == parted.failures


def test_every_cell_is_in_one_block_and_pairs_are_together(tmp_path: Path) -> None:
    parts = EvaluatedParts(many(240, 12).write(tmp_path / 'rows', 5, seed=1))
    blocks = list(CellBlocks(parts, 60))
    keys = [key for block in blocks for key in block.keys.to_pylist()]
    assert len(keys) == len(set(keys)) == 240
    # Half of each block is idm's, for each of its cells there is one of the other planner.
    assert len(blocks) == 4 and all(30 <= len(block.keys) <= 90 for block in blocks)
    for block in blocks:
        assert set(np.unique(block.pairs, return_counts=True)[1].tolist()) == {2}


def test_another_planner_does_not_change_the_others(tmp_path: Path) -> None:
    rows = many(120, 3)
    before = summarise(rows.write(tmp_path / 'before'))
    rows.add(planner='a new one', scenario='ZAM_Made-0_1_T-1', avs=[{'worst_ttc': 1.0}])
    after = summarise(rows.write(tmp_path / 'after'))
    assert after.groups[1:] == before.groups


def test_a_cell_that_was_run_again_counts_once(tmp_path: Path) -> None:
    rows = Evaluation()
    for _ in range(2):
        rows.add(avs=[{'worst_ttc': 1.0}, {'worst_ttc': 3.0}], seed=1)
    rows.add('timeout', 'too long', seed=2)
    rows.add(avs=[{'worst_ttc': 5.0}], seed=2)
    found = summarise(rows.write(tmp_path / 'rows', 4))
    ttc = _of(found, 'worst_ttc', 'idm')
    assert (found.cells, found.failed, ttc.n, ttc.value) == (2, 0, 2, 3.5)
    assert not found.failures


def test_groups_of_several_factors(tmp_path: Path) -> None:
    found = summarise(many(80, 4).write(tmp_path / 'rows'), by=('human', 'planner'),
                      measures=['failed', 'distance'], baseline='mine')
    assert [group.labels for group in found.groups] == [
        ('', 'idm'), ('', 'mine'), ('timid', 'idm'), ('timid', 'mine')]
    assert [group.labels for group in found.differences] == [('', 'idm'), ('timid', 'idm')]
    assert [measure.name for measure in found.measures] == ['failed', 'distance']


def test_games_stand_for_scenarios_that_are_not_named(tmp_path: Path) -> None:
    rows = Evaluation()
    for number in range(6):
        rows.add(scenario='', game=f'game {number}', avs=[{'distance': 1.0}])
    found = summarise(rows.write(tmp_path / 'rows'))
    assert found.scenarios == 6 and found.groups[0].clustered == 'scenarios'


def test_parts_of_another_version_are_taken_for_what_they_have(tmp_path: Path) -> None:
    """A column that a part lacks is unknown there: neither zero nor no collision."""
    rows = Evaluation()
    for seed in range(4):
        rows.add(avs=[{'distance': 100.0, 'collided': True}], seed=seed)
    folder = rows.write(tmp_path / 'rows', 2)
    path = folder / 'vehicles' / 'part-000001.parquet'
    part = pq.read_table(path).drop_columns(['collided', 'game'])
    part = part.append_column('from the future', pa.array([[1], [2]]))
    pq.write_table(part.set_column(part.schema.get_field_index('distance'), 'distance',
                                   pa.array([40, 60], pa.int32())), path)
    found = summarise(folder)
    distance, collision = (_of(found, name, 'idm') for name in ('distance', 'collision'))
    assert (distance.value, distance.n) == (75.0, 4)
    assert (collision.value, collision.n) == (1.0, 2)


def test_everything_failed(tmp_path: Path) -> None:
    rows = Evaluation()
    rows.add('error', 'no such planner')
    found = summarise(rows.write(tmp_path / 'rows'))
    assert [measure.name for measure in found.measures] == ['failed']
    assert found.groups[0].estimates[0].value == 1.0
    assert np.isnan(found.groups[0].estimates[0].low)
    assert found.worst == () and found.differences == () and found.baseline == ''


def test_what_is_added_meanwhile_is_not_read(tmp_path: Path) -> None:
    folder = many(20, 2).write(tmp_path / 'rows', 2)
    parts = EvaluatedParts(folder)
    content = (folder / 'cells' / 'part-000000.parquet').read_bytes()
    (folder / 'cells' / 'part-000002.parquet').write_bytes(content)
    read = parts.batches('cells', {'cell': pa.string()})
    assert sum(batch.rows.num_rows for batch in read) == parts.rows == 20


def test_a_goal_is_not_missed_without_scores(tmp_path: Path) -> None:
    """The time of reaching it is empty in both cases; only the scored ones count."""
    rows = Evaluation()
    for seed, (reached_s, valid) in enumerate((
            (8.0, True), (None, False), (None, True), (None, None))):
        rows.add(seed=seed, avs=[{'score_reached_s': reached_s, 'score_valid': valid}])
    found = summarise(rows.write(tmp_path / 'rows'))
    goal, valid = (_of(found, name, 'idm') for name in ('goal_reached', 'valid'))
    assert (goal.value, goal.n) == (pytest.approx(1.0 / 3.0), 3)
    assert (valid.value, valid.n) == (pytest.approx(2.0 / 3.0), 3)


def test_any_column_of_vehicles_may_be_asked_for(tmp_path: Path) -> None:
    rows = Evaluation()
    for seed, ttc in enumerate((3.0, 1.0, 2.0)):
        rows.add(seed=seed, avs=[{'worst_ttc_2d': ttc}])
    found = summarise(rows.write(tmp_path / 'rows'), measures=['worst_ttc_2d'],
                      worst=['worst_ttc_2d'])
    assert found.measures[0].unit == 's' and found.groups[0].estimates[0].value == 2.0
    assert [cell.values for cell in found.worst] == [(1.0,), (2.0,), (3.0,)]


@pytest.mark.parametrize(('wanted', 'said'), [
    ({'measures': ['speeed']}, "no measure 'speeed' here"),
    ({'by': ('seed',)}, "--by: ['seed'] contains an unknown factor"),
    ({'baseline': 'theirs'}, "no planner 'theirs' here; there are idm, mine"),
    ({'baseline': 'idm', 'by': ('human',)}, 'no planners to compare'),
    ({'worst': ['distance']}, 'nothing tells a worse distance'),
    ({'worst': ['failed']}, 'nothing tells a worse failed')])
def test_what_cannot_be_done_is_told(tmp_path: Path, wanted: dict, said: str) -> None:
    folder = many(60, 30).write(tmp_path / 'rows')
    with pytest.raises(InputError) as told:
        summarise(folder, **wanted)
    assert said in str(told.value)


def test_a_folder_that_is_no_evaluation_is_refused(tmp_path: Path) -> None:
    for said in ('no such folder', 'no cell is finished'):
        with pytest.raises(InputError, match=said):
            summarise(tmp_path / 'rows')
        (tmp_path / 'rows').mkdir(exist_ok=True)
    folder = many(4, 2).write(tmp_path / 'whole')
    part = folder / 'vehicles' / 'part-000000.parquet'
    content = part.read_bytes()
    part.write_bytes(content[:len(content) // 2])
    with pytest.raises(InputError, match='part-000000.parquet: cannot be read'):
        summarise(folder)
    table = pa.table({'cell': ['a'], 'vehicle': ['av0'], 'role': ['autonomous'],
                      'worst_ttc': ['short']})
    pq.write_table(table, part)
    with pytest.raises(InputError, match='part-000000.parquet: cannot be read'):
        summarise(folder)
    pq.write_table(table.drop_columns(['role']), part)
    with pytest.raises(InputError, match='has no column role'):
        summarise(folder)


def test_what_comes_of_almost_equal_speeds_does_not_make_the_mean() -> None:
    ttc = MEASURES['worst_ttc']
    values = ttc.values(np.array([2.0, 9.0, 3e14, math.nan, math.inf]))
    assert np.array_equal(values, [2.0, 9.0, 20.0, math.nan, math.nan], equal_nan=True)
    assert ttc.definition.endswith('greater ones count as 20')


@pytest.mark.parametrize(('name', 'better'), [
    ('worst_ttc', 1), ('worst_drac', -1), ('worst_a_req', 1), ('tet_s', -1),
    ('red_lights_run', -1), ('score_comfort', 1), ('score_jb1', -1), ('score_valid', 1),
    ('score_last_distance', -1), ('distance', 0), ('drive_speed_mean', 0)])
def test_it_is_known_which_values_are_better(name: str, better: int) -> None:
    """Also of columns that only `--measure` asks for."""
    assert better_of(name) == better


def test_a_negligible_difference_is_not_told(tmp_path: Path) -> None:
    """Rounding, and less than matters; in all scenarios, so that it is not by chance."""
    for more, side in ((4e-12, 0), (0.004, 0), (0.02, 1)):
        rows = Evaluation()
        for number in range(6):
            for planner, ttc in (('idm', 2.14), ('mine', 2.14 + more)):
                rows.add(planner=planner, scenario=f'ZAM_S-{number}_1_T-1',
                         avs=[{'worst_ttc': ttc}])
        found = summarise(rows.write(tmp_path / str(more)))
        difference = _of(found, 'worst_ttc', 'mine', difference=True)
        assert difference.value == pytest.approx(more, rel=1e-3)
        assert difference.side(MEASURES['worst_ttc'].negligible) == side
