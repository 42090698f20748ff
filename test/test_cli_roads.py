# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame roads`: its files, its output, and the files that it does not overwrite."""

from pathlib import Path
import subprocess
import sys

from crgame_ros.cli import main
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.waypoints.roads import LaneLinks, WaypointRoads
import pytest

TABLE = """\
lane,x,y,width,speed_limit,successors
1,0,0,3.5,13.9,2
1,40,0,3.5,8.3,
1,80,0,3.5,8.3,
2,80,0,3.5,,
2,120,0,3.5,,
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Write a table of two lanes."""
    (tmp_path / 'roads.csv').write_text(TABLE, encoding='utf-8')
    return tmp_path / 'roads.csv'


def run(*words: object) -> int:
    """Run the command in this process."""
    return main(['roads', *map(str, words)])


def test_a_scenario_and_a_line_about_it(table: Path, tmp_path: Path,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    """Folders above it are made, nothing else is left there, and cut lanes are named."""
    out = tmp_path / 'maps' / 'My town.xml'
    assert run(table, out) == 0
    told = capsys.readouterr()
    assert told.out == f'{out}: 3 lanelets of 2 lanes, 120 m of lane, no planning problems\n'
    assert told.err.splitlines() == [
        'note: lane 1 is lanelet 1, then 3',
        'note: it has no planning problem, so games on it have no AV (see --start and --goal); '
        "only CommonRoad's own schema asks for one"]
    assert [path.name for path in out.parent.iterdir()] == ['My town.xml']
    loaded = load_scenario(out)
    assert loaded.benchmark_id == 'ZAM_Mytown-1_1_T-1'
    assert [x.lanelet_id for x in loaded.scenario.lanelet_network.lanelets] == [1, 3, 2]
    # The same way-points give the same bytes, which do not contain their path.
    again = tmp_path / 'again' / out.name
    assert run(table, again) == 0
    assert again.read_bytes() == out.read_bytes()
    assert str(tmp_path) not in out.read_text(encoding='utf-8')


def test_a_planning_problem(table: Path, tmp_path: Path,
                            capsys: pytest.CaptureFixture[str]) -> None:
    """Start and goal make one; the type is that of every lanelet."""
    out = tmp_path / 'roads.xml'
    assert run(table, out, '--type', 'highway', '--start', '1:10.5:8', '--goal', 2) == 0
    assert capsys.readouterr().out.endswith(', 1 planning problem\n')
    loaded = load_scenario(out)
    problem, = loaded.planning_problems
    assert problem.initial_state.position.tolist() == [10.5, 0.0]
    assert problem.initial_state.velocity == 8.0
    assert problem.goal.lanelets_of_goal_position == {0: [2]}
    assert {item.value for x in loaded.scenario.lanelet_network.lanelets
            for item in x.lanelet_type} == {'highway'}


def test_a_table_of_a_scenario(project_root: Path, tmp_path: Path,
                               capsys: pytest.CaptureFixture[str]) -> None:
    """Its parking lane is left out, with the links to it, unless all lanelets are wanted."""
    scenario = project_root / 'scenarios' / 'ZAM_ParkedCars-1_1_T-1.xml'
    lanes = {}
    for name, words in (('cars', ()), ('all', ('--all',))):
        assert run(scenario, tmp_path / f'{name}.csv', *words) == 0
        told = capsys.readouterr()
        roads = WaypointRoads.from_csv(tmp_path / f'{name}.csv')
        lanes[name] = roads.lane_ids
        points = sum(len(roads.lane(lane).s) for lane in roads.lane_ids)
        assert told.out == (f'{tmp_path / name}.csv: {points} way-points of '
                            f'{len(roads.lane_ids)} lanes\n')
        assert told.err == ('' if words else 'note: 2 lanelets not for cars left out; '
                            'add --all to write them\n')
    assert len(lanes['cars']) == 4 and len(lanes['all']) == 6
    assert set(lanes['cars']) < set(lanes['all'])


def test_lanes_that_are_left_out_take_their_links_along() -> None:
    """The lanes that are kept have no links to missing ones."""
    links = LaneLinks((2, 3), (4,), left=5, right=2, oncoming_left=6, oncoming_right=3)
    assert links.only({2, 6}) == LaneLinks((2,), (), right=2, oncoming_left=6)


def test_what_is_there_stays(table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
                             ) -> None:
    """A file is replaced with --force only; a folder or a link never."""
    out = tmp_path / 'roads.xml'
    out.write_text('dear')
    assert run(table, out) == 2
    assert capsys.readouterr().err == (
        f'error: {out}: is there already; add --force to replace it\n')
    assert out.read_text() == 'dear'
    assert run(table, out, '--force') == 0
    assert len(load_scenario(out).scenario.lanelet_network.lanelets) == 3
    # The same in the other direction.
    before = table.read_text()
    assert run(out, table) == 2
    assert table.read_text() == before
    assert run(out, table, '--force') == 0
    assert WaypointRoads.from_csv(table).lane_ids == (1, 3, 2)
    (tmp_path / 'folder.xml').mkdir()
    (tmp_path / 'link.xml').symlink_to(out)
    capsys.readouterr()
    for name in ('folder.xml', 'link.xml'):
        assert run(table, tmp_path / name, '--force') == 2
        assert capsys.readouterr().err == (
            f'error: {tmp_path / name}: is no plain file; name another\n')


def test_a_refused_table_leaves_the_old_file(table: Path, tmp_path: Path) -> None:
    """With --force too, and no half a file beside it."""
    out = tmp_path / 'roads.xml'
    out.write_text('dear')
    table.write_text(TABLE.replace('80,0,3.5,,', '90,0,3.5,,', 1), encoding='utf-8')
    assert run(table, out, '--force') == 2
    assert out.read_text() == 'dear'
    assert sorted(path.name for path in tmp_path.iterdir()) == ['roads.csv', 'roads.xml']


@pytest.mark.parametrize(('words', 'message'), [
    (('{table}',), 'crgame roads: the following arguments are required: OUT; see --help'),
    (('{table}', '{out}.txt'), 'cannot turn roads.csv into new.txt; name way-points (.csv) and'),
    (('none.csv', '{out}.xml'), 'none.csv: cannot read the way-points (No such file or dir'),
    (('none.xml', '{out}.csv'), 'none.xml: cannot be read (No such file or directory)'),
    (('{table}', '{out}.xml', '--type', 'sidewalk'), "--type: invalid choice: 'sidewalk'"),
    (('{table}', '{out}.xml', '--start', '1:0:0'), '--start: there is no --goal; a planning'),
    (('{table}', '{out}.xml', '--goal', '2'), '--goal: there is no --start; a planning problem'),
    (('{table}', '{out}.xml', '--start', '1:0', '--goal', '2'),
     '--start: is "1:0"; give LANE:S:SPEED, for example 7:10:8.3'),
    (('{table}', '{out}.xml', '--start', 'a:0:0', '--goal', '2'), "--start: 'a' is no lane; give"),
    (('{table}', '{out}.xml', '--start', '1:nan:0', '--goal', '2'), '--start: is "1:nan:0"'),
    (('{table}', '{out}.xml', '--start', '2:0:0', '--goal', '1'), '--goal: no way leads from'),
    (('{table}', '{out}.xml', '--all'), '--all: only lanelets can be left out'),
    (('{table}.xml', '{out}.csv', '--type', 'urban'), '--type: way-points have none; give it'),
], ids=['no out', 'kinds', 'no table', 'no scenario', 'type', 'no goal', 'no start', 'short start',
        'start lane', 'nan', 'no way', 'all', 'type of a table'])
def test_bad_input_is_one_line(words: tuple[str, ...], message: str, table: Path, tmp_path: Path,
                               capsys: pytest.CaptureFixture[str]) -> None:
    """It has exit code 2 and names fault, place and remedy; nothing is written."""
    assert run(*(word.format(table=table, out=tmp_path / 'new') for word in words)) == 2
    told = capsys.readouterr()
    assert told.err.startswith('error: ') and message in told.err
    assert told.err.count('\n') == 1
    assert list(tmp_path.iterdir()) == [table]


@pytest.mark.parametrize(('change', 'message'), [
    (('13.9,2', '13.9,7'), 'line 2: lane 1 is linked with lane 7, which does not exist'),
    (('40,0', '40,a'), """line 3: "y" is 'a'; give a finite number"""),
    (('80,0,3.5,,', '90,0,3.5,,'), 'lane 1: lane 2 follows lane 1, but begins 10.0 m from'),
    (('40,0,3.5', '40,9,400'), 'm: the right bound turns back: the bend has a radius of'),
], ids=['unknown link', 'no number', 'gap', 'bound turns back'])
def test_bad_tables_are_one_line(change: tuple[str, str], message: str, table: Path,
                                 tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message names the file, and the line or the lane."""
    table.write_text(TABLE.replace(*change, 1), encoding='utf-8')
    assert run(table, tmp_path / 'new.xml') == 2
    told = capsys.readouterr()
    assert told.err.startswith(f'error: {table}, ') and message in told.err
    assert told.err.count('\n') == 1
    assert list(tmp_path.iterdir()) == [table]


@pytest.mark.parametrize('folder', ['/proc/none', '/dev/null'])
def test_places_that_cannot_be_written(folder: str, table: Path,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    """One line that names the file."""
    assert run(table, f'{folder}/roads.xml') == 2
    error = capsys.readouterr().err.splitlines()[0]
    assert error.startswith(f'error: {folder}/roads.xml: cannot ')
    assert error.endswith('; choose another place')


def test_other_commands_do_not_wait_for_it() -> None:
    """Naming the arguments imports none of the libraries that the work needs."""
    code = ("import sys; from crgame_ros.cli import _build_parser; _build_parser('info'); "
            "sys.exit(any(name in sys.modules for name in ('scipy', 'shapely', 'commonroad', "
            "'numpy', 'lxml')))")
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0
