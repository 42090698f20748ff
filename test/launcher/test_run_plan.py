# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the command line to a checked run and its folder."""

from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
import socket

from crgame_ros.errors import InputError
from crgame_ros.game.game import Game, HumanSpec, load_game
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_game, plan_run
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.setup import build_setup
import pytest

SCENARIOS = scenarios_directory()
CUT_IN, TWO_AVS = SCENARIOS / 'cut_in.yaml', SCENARIOS / 'two_avs.yaml'
CUT_IN_XML = SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml'
NOON = datetime(2026, 3, 4, 12, 5, 6)
PLANNER = """\
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Mine(ConstantVelocityPlanner):
    name = 'mine'
"""


def noon() -> datetime:
    """Stand in for the wall clock."""
    return NOON


@pytest.fixture(autouse=True)
def in_an_empty_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Start every test in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_without_arguments_it_is_the_cut_in() -> None:
    """It is the game of the README's first command, unchanged."""
    assert effective_game(RunRequest()) == load_game(CUT_IN)


def test_scenario_alone() -> None:
    """One human is placed near the first AV; each planning problem becomes an AV."""
    game = effective_game(RunRequest(scenario=CUT_IN_XML))
    assert (game.scenario, game.humans, game.avs) == (CUT_IN_XML, (HumanSpec('hv0'),), None)


def test_overrides() -> None:
    """The command line takes precedence over the game file; all else stays."""
    before = load_game(TWO_AVS)
    game = effective_game(RunRequest(TWO_AVS, CUT_IN_XML, 'idle', (), 7.0, 250.0))
    assert game.scenario == CUT_IN_XML
    assert game.humans[0].driver == 'idle'
    assert game.humans[0].spawn == before.humans[0].spawn
    assert (game.duration, game.timing.rate) == (7.0, 250.0)
    assert (game.avs, game.title, game.seed) == (before.avs, before.title, before.seed)


def test_driver_file_is_relative_to_the_present_directory(tmp_path: Path) -> None:
    """Unlike one in the game file, which is relative to that; device names are no files."""
    for given, expected in (('keys:mine.yaml', f'keys:{tmp_path}/mine.yaml'),
                            ('replay:runs/one/bag', f'replay:{tmp_path}/runs/one/bag'),
                            ('evdev:Logitech G29', 'evdev:Logitech G29'), ('auto', 'auto')):
        assert effective_game(RunRequest(driver=given)).humans[0].driver == expected


@pytest.mark.parametrize('rate', [0.5, 20_000.0])
def test_rate_is_bounded_as_in_the_file(rate: float) -> None:
    """From 1 to 10000 Hz."""
    with pytest.raises(InputError, match='--rate: "rate" is .* from 1 to 10000'):
        effective_game(RunRequest(rate_hz=rate))


def test_driver_without_a_human_is_refused(tmp_path: Path) -> None:
    """The game has no human: the argument would have no effect."""
    path = tmp_path / 'alone.yaml'
    path.write_text(f'scenario: {CUT_IN_XML}\nhumans: []\n', encoding='utf-8')
    assert effective_game(RunRequest(path)).humans == ()
    with pytest.raises(InputError, match='--driver: the game has no human'):
        effective_game(RunRequest(path, driver='idle'))


def test_folder_is_named_by_time_and_scenario(tmp_path: Path) -> None:
    """runs/<time>_<benchmark id>; a second run in the same second gets a number."""
    names = [plan_run(RunRequest(CUT_IN), noon).folder for _ in range(3)]
    stem = '20260304-120506_ZAM_CutIn-1_1_T-1'
    assert names == [tmp_path / 'runs' / f'{stem}{suffix}' for suffix in ('', '_2', '_3')]
    assert all(folder.is_dir() for folder in names)


def test_given_folder_is_used(tmp_path: Path) -> None:
    """It may exist, as long as it holds no recording; else one beside it is used."""
    (tmp_path / 'mine').mkdir()
    plan = plan_run(RunRequest(CUT_IN, out=Path('mine')), noon)
    assert plan.folder == tmp_path / 'mine'
    assert plan.bag == tmp_path / 'mine' / 'bag'
    for number in (2, 3):
        plan.bag.mkdir()
        plan = plan_run(RunRequest(CUT_IN, out=Path('mine')), noon)
        assert plan.folder == tmp_path / f'mine_{number}'


@pytest.mark.parametrize('out', [None, Path('mine')])
def test_ten_starts_at_once_have_ten_folders(tmp_path: Path, out: Path | None) -> None:
    """This holds also if the folder that they all name exists already."""
    (tmp_path / 'mine').mkdir()
    with ThreadPoolExecutor(10) as pool:
        plans = list(pool.map(lambda _: plan_run(RunRequest(CUT_IN, out=out), noon), range(10)))
    assert len({plan.folder for plan in plans}) == 10
    assert all(plan.game_file.is_file() for plan in plans)


def test_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    """A file stands in its place."""
    (tmp_path / 'file').write_text('', encoding='utf-8')
    with pytest.raises(InputError, match='file/run: cannot be made .*--out'):
        plan_run(RunRequest(CUT_IN, out=Path('file/run')), noon)


def test_drivers_are_given_by_name() -> None:
    """Named humans get them, the others keep theirs; unknown names are reported."""
    game = Game(CUT_IN_XML, humans=(HumanSpec('hv0'), HumanSpec('hv1', 'idle')))
    named = effective_game(RunRequest(drivers=(('hv1', 'cockpit'),)), game)
    assert [human.driver for human in named.humans] == ['auto', 'cockpit']
    with pytest.raises(InputError, match='--driver: the game has no hv7; it has hv0, hv1'):
        effective_game(RunRequest(drivers=(('hv7', 'idle'),)), game)


def test_written_game_is_the_run() -> None:
    """The game in the folder gives the same vehicles, AVs spelled out as they were found."""
    plan = plan_run(RunRequest(scenario=CUT_IN_XML, planners=('constant-velocity',),
                               driver='idle', duration_s=3.0), noon)
    again = build_setup(load_game(plan.game_file))
    assert [human.state for human in again.humans] == [
        human.state for human in plan.setup.humans]
    assert [(av.id, av.state, av.spec) for av in again.avs] == [
        (av.id, av.state, av.spec) for av in plan.setup.avs]
    assert again.avs[0].spec.planner == 'constant-velocity'
    assert again.avs[0].spec.planning_problem == 100
    assert again.game.duration == 3.0
    assert again.scheduler == plan.setup.scheduler


def test_one_planner_serves_all_and_several_go_in_order() -> None:
    """--planner once, or once for each AV."""
    for planners, expected in (((), ['idm', 'idm']),
                               (('constant-velocity',), ['constant-velocity'] * 2),
                               (('constant-velocity', 'idm'), ['constant-velocity', 'idm'])):
        plan = plan_run(RunRequest(TWO_AVS, planners=planners), noon)
        assert [av.spec.planner for av in plan.setup.avs] == expected


def test_options_belong_to_their_planner(tmp_path: Path) -> None:
    """Another planner doesn't get them; the same one keeps them."""
    path = tmp_path / 'game.yaml'
    path.write_text(f'scenario: {CUT_IN_XML}\navs: [{{planner: idm, options: {{v0: 15.0}}}}]\n',
                    encoding='utf-8')
    for planners, options in (((), {'v0': 15.0}), (('idm',), {'v0': 15.0}),
                              (('constant-velocity',), {})):
        plan = plan_run(RunRequest(path, planners=planners, driver='idle'), noon)
        assert plan.setup.avs[0].spec.options == options


def test_planner_of_the_users_own(tmp_path: Path) -> None:
    """A file named from here is written down so that it is found from anywhere."""
    (tmp_path / 'mine.py').write_text(PLANNER, encoding='utf-8')
    plan = plan_run(RunRequest(CUT_IN, planners=('mine.py:Mine',)), noon)
    written = load_game(plan.game_file)
    assert written.avs is not None
    assert written.avs[0].planner == f'{tmp_path}/mine.py:Mine'


@pytest.mark.parametrize(('request_', 'named'), [
    (RunRequest(Path('none.yaml')), 'none.yaml: cannot read the game file'),
    (RunRequest(scenario=Path('none.xml')), 'none.xml'),
    (RunRequest(scenario=CUT_IN), 'cut_in.yaml'),
    (RunRequest(driver='telepathy'), 'no driver source'),
    (RunRequest(driver='keys:none.yaml'), 'none.yaml'),
    (RunRequest(planners=('none',)), 'there is no planner "none"'),
    (RunRequest(planners=('none.py:Mine',)), 'there is no file none.py'),
    (RunRequest(planners=('idm', 'idm')), '--planner: 2 planners for 1 AVs')])
def test_bad_request_ends_before_anything_is_made(tmp_path: Path, request_: RunRequest,
                                                  named: str) -> None:
    """Exit code 2, one line, no folder."""
    with pytest.raises(InputError) as caught:
        plan_run(request_, noon)
    assert named in str(caught.value)
    assert caught.value.exit_code == 2
    assert '\n' not in str(caught.value)
    assert not (tmp_path / 'runs').exists()


CROSSING = SCENARIOS / 'crossing.yaml'


def test_planners_of_events_are_checked(tmp_path: Path) -> None:
    """An unknown one, or one for an external planner's AV, is refused before any start."""
    text = CROSSING.read_text().replace('scenario: ', f'scenario: {SCENARIOS}/').replace(
        'joy:crossing', f'joy:{SCENARIOS}/crossing')
    game = tmp_path / 'game.yaml'
    game.write_text(text.replace('{av: av0, planner: idm', '{av: av0, planner: x'))
    with pytest.raises(InputError, match='there is no planner "x"'):
        plan_run(RunRequest(game), noon)
    with pytest.raises(InputError, match='event careful-planner: av0 has an external planner'):
        plan_run(RunRequest(CROSSING, planners=('external',)), noon)
    plan = plan_run(RunRequest(CROSSING), noon)
    assert load_game(plan.game_file).events == load_game(CROSSING).events


@pytest.mark.parametrize('address', ['192.0.2.1', 'nobody.invalid', '"', 'a' * 70],
                         ids=['of another machine', 'unknown', 'a quote', 'too long'])
def test_the_page_has_to_be_at_an_address_of_this_machine(address: str, tmp_path: Path) -> None:
    """The refusal comes before the start: a run that waits for the browser would never begin."""
    with pytest.raises(InputError, match=r'cannot listen \(.+\); choose another|is no address'):
        plan_run(RunRequest(listen=address, out=tmp_path / 'run'))
    assert not (tmp_path / 'run').exists()
    plan_run(RunRequest(listen=address, out=tmp_path / 'run', headless=True))


def test_a_port_that_is_taken_is_no_reason_to_refuse(tmp_path: Path) -> None:
    """The cockpit takes the next one."""
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        plan_run(RunRequest(port=taken.getsockname()[1], out=tmp_path / 'run'))
