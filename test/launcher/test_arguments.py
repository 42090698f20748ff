# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command line of run.sh."""

from pathlib import Path

from crgame_ros.cockpit.exposure import check_certificate
from crgame_ros.errors import InputError
from crgame_ros.launcher.arguments import cockpit_host, parse_arguments, RunRequest
from crgame_ros.launcher.run_plan import effective_setup
from crgame_ros.paths import default_game
import pytest


def test_without_arguments() -> None:
    """Everything is left to the game, in real time."""
    assert parse_arguments([]) == RunRequest()
    assert parse_arguments([]).real_time_factor == 1.0


def test_every_argument() -> None:
    """The arguments are those of the README."""
    request = parse_arguments([
        'games/mine.yaml', '--scenario', 'road.xml', '--driver', 'evdev:Logitech G29',
        '--planner', 'idm', '--planner', 'mine.py:Mine', '--duration', '20', '--rate', '200',
        '--real-time-factor', '0.5', '--headless', '--port', '9000', '--listen', '0.0.0.0',
        '--realtime-priority', '--no-report', '--out', 'there'])
    assert request == RunRequest(
        Path('games/mine.yaml'), Path('road.xml'), 'evdev:Logitech G29', ('idm', 'mine.py:Mine'),
        20.0, 200.0, 0.5, True, 9000, '0.0.0.0', realtime_priority=True, no_report=True,
        out=Path('there'))


def test_each_human_gets_the_driver_that_is_named_for_it() -> None:
    """Without a name it is the first human's, whatever characters the source has."""
    request = parse_arguments(['--driver', 'hv1=evdev:G29', '--driver', 'keys:a=b.yaml',
                               '--driver', 'hv0=cockpit'])
    assert request.driver == 'keys:a=b.yaml'
    assert request.drivers == (('hv1', 'evdev:G29'), ('hv0', 'cockpit'))
    with pytest.raises(InputError, match='--driver: names hv0 twice'):
        parse_arguments(['--driver', 'hv0=idle', '--driver', 'hv0=auto'])


def test_a_cockpit_is_opened_on_purpose() -> None:
    """It is on all addresses unless one is given; contradictory arguments are refused."""
    request = parse_arguments(['--open-cockpit', '--certificate', 'c.pem', '--key', 'k.pem'])
    assert cockpit_host(request) == '0.0.0.0' and cockpit_host(RunRequest()) == '127.0.0.1'
    assert cockpit_host(parse_arguments(['--open-cockpit', '--listen', '10.0.0.4'])) == '10.0.0.4'
    for pair in ((Path('c.pem'), None), (None, Path('k.pem'))):
        with pytest.raises(InputError, match='give --certificate and --key'):
            check_certificate(*pair)
    for words, named in ((['--headless', '--token'], 'there is no page'),
                         (['--replay', 'bag', '--open-cockpit'], '--replay')):
        with pytest.raises(InputError, match=named):
            parse_arguments(words)


def test_named_origins_may_show_the_cockpit_within_its_page() -> None:
    """No origin may unless it is named; without a page, or with a recording's, none can."""
    assert parse_arguments([]).framed_by == ()
    request = parse_arguments(['--framed-by', 'http://LocalHost:8070/',
                               '--framed-by', 'http://[::1]:8071'])
    assert list(request.framed_by) == ['http://localhost:8070', 'http://[::1]:8071']
    for words, named in ((['--framed-by', 'http://*:8070'], 'argument --framed-by.*is no origin'),
                         (['--framed-by', 'http://a:1', '--headless'], 'there is no page'),
                         (['--framed-by', 'http://a:1', '--replay', 'bag'], '--replay')):
        with pytest.raises(InputError, match=named):
            parse_arguments(words)


@pytest.mark.parametrize(('arguments', 'named'), [
    (['--duration', 'long'], 'argument --duration: long is no number'),
    (['--duration', '0'], 'argument --duration: 0 is not above 0'),
    (['--duration', '-3'], 'argument --duration'), (['--duration', 'nan'], 'argument --duration'),
    (['--duration', 'inf'], 'argument --duration'), (['--rate', '0'], 'argument --rate'),
    (['--rate', '-5'], 'argument --rate'), (['--rate'], 'argument --rate: expected one'),
    (['--real-time-factor', '0.05'], 'not within 0.1 to 10'),
    (['--real-time-factor', '11'], 'not within 0.1 to 10'),
    (['--real-time-factor', 'nan'], 'not within'), (['--colour', 'red'], '--colour'),
    (['--port', '0'], 'argument --port: 0 is no port'), (['--port', '65536'], 'no port'),
    (['--port', 'x'], 'no port'), (['--port', '-1'], 'argument --port'),
    (['one.yaml', 'two.yaml'], 'two.yaml'), (['--headless=yes'], '--headless')])
def test_bad_argument_is_refused(arguments: list[str], named: str) -> None:
    """One line that names the argument, exit code 2, no usage text in between."""
    with pytest.raises(InputError) as caught:
        parse_arguments(arguments)
    assert named in str(caught.value)
    assert str(caught.value).startswith('command line: ')
    assert str(caught.value).endswith('see --help')
    assert caught.value.exit_code == 2


def test_help_teaches(capsys: pytest.CaptureFixture[str]) -> None:
    """It ends with code 0 and shows examples, driver sources and planners."""
    with pytest.raises(SystemExit) as caught:
        parse_arguments(['--help'])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert text.startswith('usage: run.sh')
    for word in ('examples:', 'replay:BAG', 'idm', 'reactive', '--real-time-factor'):
        assert word in text


def test_games_of_the_package_have_names_and_scenarios_need_no_option(tmp_path: Path) -> None:
    assert parse_arguments(['cut_in']).game == default_game()
    request = parse_arguments(['road.xml'])
    assert (request.game, request.scenario) == (None, Path('road.xml'))
    # A file of that name goes first; anything else that is named like a file is one.
    assert parse_arguments(['games/mine.yaml']).game == Path('games/mine.yaml')
    with pytest.raises(InputError, match='neither a file nor one of the games .*cut_in, '):
        parse_arguments(['nothing_like_it'])


def test_a_folder_does_not_hide_a_game(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'cut_in').mkdir()
    assert parse_arguments(['cut_in']).game == default_game()


def test_options_of_planners_are_written_as_in_a_game() -> None:
    """Numbers, lists and texts; what is no option is refused with its text."""
    request = parse_arguments(['--option', 'v0=12.5', '--option', 'levels=[1, 2]',
                               '--option', 'name=a=b'])
    assert dict(request.options) == {'v0': 12.5, 'levels': [1, 2], 'name': 'a=b'}
    with pytest.raises(InputError, match='--option: is "v0"; give KEY=VALUE'):
        parse_arguments(['--option', 'v0'])
    with pytest.raises(InputError, match='--option v0'):
        parse_arguments(['--option', 'v0=[1'])


@pytest.mark.slow
def test_options_reach_the_planners_before_those_of_the_game(project_root: Path) -> None:
    """An option that the planner does not have is refused as one of a game file is."""
    game = project_root / 'scenarios' / 'cut_in.yaml'
    setup = effective_setup(parse_arguments([str(game), '--option', 'v0=12.5']))
    assert [av.spec.options['v0'] for av in setup.avs] == [12.5]
