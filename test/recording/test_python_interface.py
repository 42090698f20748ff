# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Python interface: as documented, and the same as the commands."""

import ast
from dataclasses import replace
import json
import math
from pathlib import Path
import pickle
import re
import subprocess
import sys
from typing import Any

import crgame_ros
from crgame_ros.cli import main
from crgame_ros.messages.plan import Plan
from crgame_ros.paths import scenarios_directory
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner
from crgame_ros.planner.registry import PLANNERS
from crgame_ros.python_interface.offline_runs import OfflineRun
import polars
import pytest

ROOT = Path(__file__).resolve().parents[2]
CUT_IN = scenarios_directory() / 'cut_in.yaml'
CROSSING = scenarios_directory() / 'crossing.yaml'


class Failing(crgame_ros.Planner):
    """Finds nothing."""

    name = 'failing'
    asked = 0

    def setup(self, context: crgame_ros.PlannerContext) -> None:
        """Do nothing."""

    def plan(self, request: crgame_ros.PlanRequest) -> Plan:
        """Find nothing."""
        type(self).asked += 1
        raise crgame_ros.PlanningError('there is no way')


@pytest.fixture(scope='module')
def run() -> OfflineRun:
    """Drive the cut-in for three seconds."""
    return crgame_ros.run(CUT_IN, duration_s=3.0)


@pytest.fixture(scope='module')
def folder(run: OfflineRun, recorder: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of its recording."""
    found: Path = tmp_path_factory.mktemp('runs') / 'NAME'
    recorder.ours(found / 'bag', recorder.messages(run.result))
    return found


def test_importing_the_package_loads_nothing() -> None:
    """Only the package itself is loaded before a name is used."""
    code = ('import sys; before = set(sys.modules); import crgame_ros; '
            'print(*sorted(set(sys.modules) - before)); crgame_ros.InputError; '
            'print(*sorted(name for name in sys.modules if name.startswith("crgame_ros")))')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, cwd=ROOT)
    assert done.stdout.split('\n')[:2] == ['crgame_ros', 'crgame_ros crgame_ros.errors']


def test_names_are_there_for_people_editors_and_types() -> None:
    """`__all__`, `dir`, the stubs for type checkers and attributes have the same names."""
    tree = ast.parse((ROOT / 'crgame_ros' / '__init__.py').read_text())
    typed = {alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
             and (node.module or '').startswith('crgame_ros') for alias in node.names}
    typed.remove('__version__')
    assert set(crgame_ros.__all__) == typed <= set(dir(crgame_ros))
    assert all(callable(getattr(crgame_ros, name)) for name in typed)
    assert not hasattr(crgame_ros, 'no_such_name')
    document = (ROOT / 'docs' / 'python.md').read_text()
    assert all(f'`{name}' in document for name in typed)


@pytest.mark.slow
def test_the_document_runs(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its lines run in order, beside the games and a recording; its claims hold."""
    (tmp_path / 'scenarios').symlink_to(scenarios_directory())
    (tmp_path / 'runs').symlink_to(folder.parent)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r'```python\n(.*?)```', (ROOT / 'docs' / 'python.md').read_text(), re.S)
    names: dict[str, Any] = {'__name__': 'notebook'}
    for block in blocks:
        exec(compile(block, 'docs/python.md', 'exec'), names)
    assert len(blocks) == 4
    assert {path.name for path in tmp_path.iterdir()} == {
        'scenarios', 'runs', 'cut_in.html', 'cut_in.xml', 'both.html', 'tables'}
    run, own, against = (names[name] for name in ('run', 'own', 'against'))
    assert run.game.seed == 3 and run.duration_s == pytest.approx(4.0)
    assert own.answers['av0'].accepted_share == 1.0
    # With less braking the AV is faster at the end.
    assert own.states_of('av0')[-1, 3] > against['notebook:Coasting'].states_of('av0')[-1, 3]
    assert against['idm'].state_hash == run.state_hash
    assert against['constant-velocity'].state_hash != run.state_hash
    assert list(against) == ['idm', 'constant-velocity', 'notebook:Coasting']
    ids = polars.read_parquet(tmp_path / 'tables' / 'runs.parquet')['run'].to_list()
    assert ids == [f'{run.name}:0', 'NAME:0']


def test_a_run_is_that_of_the_command(run: OfflineRun, capsys: pytest.CaptureFixture[str]) -> None:
    """All but the computing times is equal; also with two other planners and a trigger."""
    assert main(['offline', str(CUT_IN), '--duration', '3']) == 0
    told = json.loads(capsys.readouterr().out)
    assert {**run.summary(), 'wall_s': 0} == {**told, 'wall_s': 0}
    words = ['offline', str(CROSSING), '--duration', '2',
             '--latency', '3', '--planner', 'constant-velocity', '--trigger', 'leader-brakes@0.5']
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    again = crgame_ros.run(words[1], duration_s=2.0, latency_steps=3, planner='constant-velocity',
                           triggers={'leader-brakes': 0.5})
    assert (again.state_hash, again.summary()['events']) == (told['state_hash'], told['events'])


@pytest.mark.exhaustive
def test_a_recording_is_the_same_kind_of_object(
        run: OfflineRun, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same measures as of the run; those of the commands to the last bit."""
    recorded = crgame_ros.read_run(folder)
    assert isinstance(recorded, crgame_ros.Run) and recorded.name == 'NAME'
    assert (recorded.vehicles, recorded.duration_s) == (run.vehicles, run.duration_s)
    for name, found in run.criticality().items():
        other = recorded.criticality()[name]
        assert {key: worst.value for key, worst in found.worst.items()} == pytest.approx(
            {key: worst.value for key, worst in other.worst.items()}, rel=1e-6)
    assert main(['measure', str(folder), '--json']) == 0
    assert crgame_ros.measure(recorded).as_dict() == json.loads(capsys.readouterr().out)
    assert main(['score', str(folder), '--json']) == 0
    told = json.loads(capsys.readouterr().out)['vehicles']
    assert [each.as_dict() for each in recorded.scores().values()] == told
    assert main(['export', str(folder)]) == 0
    for name, table in recorded.tables().items():
        written = polars.read_parquet(folder / 'tables' / f'{name}.parquet')
        assert polars.from_arrow(table).equals(written), name
    assert recorded.tables(scores=False)['vehicles']['score_nuplan'].null_count == 2
    # With its own game, too.
    driver = f'replay:{folder / "bag"}'
    assert crgame_ros.run(driver=driver, duration_s=3.0).state_hash == run.state_hash
    with pytest.raises(crgame_ros.InputError, match='seed: the game is that of the recording'):
        crgame_ros.run(driver=driver, seed=1)
    # A later run of the same human is the recorded one again.
    assert crgame_ros.replay(folder, 'idm')['idm'].human_differs_s is None


@pytest.mark.slow
def test_an_offline_run_knows_what_a_recording_tells(tmp_path: Path) -> None:
    """Plans, contacts and violations, in tables and in its report, by the run's own records."""
    run = crgame_ros.run(CUT_IN, planner='constant-velocity', duration_s=12.0)
    tables = {name: table.to_pydict() for name, table in run.tables().items()}
    counters = run.result.planners['av0'].counters
    assert tables['vehicles']['score_accepted_share'] == [None, run.answers['av0'].accepted_share]
    assert tables['vehicles']['requests'] == [None, counters.requests]
    # The AV runs into the human, which has cut in and brakes.
    first = next(each.n for each in run.result.violations if not each.is_valid)
    assert [each['n'] for each in run.contacts or ()] == [first]
    assert {(each['n'], each['vehicle'], each['what']) for each in run.violations or ()} == {
        (first, 'hv0', 'collision with av0'), (first, 'av0', 'collision with hv0')}
    assert (tables['runs']['contacts'], tables['runs']['violations']) == ([1], [2])
    text = run.report(tmp_path / 'x.html').read_text()
    assert '<td>collision with av0</td>' in text.replace('<bdi>', '').replace('</bdi>', '')
    assert f'<td>{counters.requests}</td>' in text and 'An offline run keeps no clock' in text
    assert 'does not tell' not in text
    # Its report has scored it; tables without scores stay without.
    assert run.tables(scores=False)['vehicles']['score_nuplan'].null_count == 2


def test_objects_and_classes_drive_alike(run: OfflineRun) -> None:
    """Name, class and object have the same states; failures are counted, and no name stays."""
    hashes = {crgame_ros.run(CUT_IN, planner=planner, duration_s=1.0).state_hash
              for planner in ('constant-velocity', ConstantVelocityPlanner,
                              ConstantVelocityPlanner())}
    assert len(hashes) == 1
    failed = crgame_ros.run(CUT_IN, planner=Failing, duration_s=1.0)
    assert failed.answers['av0'].fallback_reasons == {'there is no way': 10}
    assert failed.game.avs[0].planner == f'{__name__}:Failing'
    with pytest.raises(crgame_ros.InputError):
        PLANNERS.find(f'{__name__}:Missing')
    assert not PLANNERS._given


def test_each_av_has_a_planner_of_its_own() -> None:
    """An object for each; one object for both is refused."""
    game = crgame_ros.load_game(scenarios_directory() / 'two_avs.yaml')
    one, other = ConstantVelocityPlanner(), ConstantVelocityPlanner()
    found = crgame_ros.run(game, planner=[one, other], duration_s=0.5)
    assert len({av.planner for av in found.game.avs}) == 2
    for planner in (one, [one, one]):
        with pytest.raises(crgame_ros.InputError, match='one object for 2 AVs'):
            crgame_ros.run(game, planner=planner, duration_s=0.5)
    # Told before the first of several planners drives.
    Failing.asked = 0
    with pytest.raises(crgame_ros.InputError, match='one object for 2 AVs'):
        crgame_ros.replay(found, [Failing, one])
    assert Failing.asked == 0


def test_the_chosen_run_of_a_recording(run: OfflineRun, recorder: Any, tmp_path: Path) -> None:
    """Everything is that of the chosen run, also what does not need its trajectories."""
    later = crgame_ros.run(CUT_IN, duration_s=0.5)
    recorder.ours(tmp_path / 'bag', [
        *recorder.messages(run.result),
        *recorder.messages(later.result, epoch=1, offset_ns=9_000_000_000,
                           log_ns=1_700_000_009_000_000_000)])
    for epoch, original in ((0, run), (1, later), (None, later)):
        chosen = crgame_ros.read_run(tmp_path, epoch)
        assert chosen.duration_s == original.duration_s
        assert chosen.timed.cycles.column('n')[-1] == len(original.result.vehicle_states) - 1


def test_a_notebook_shows_it(run: OfflineRun) -> None:
    """It has a picture, a row for each vehicle, and any game's name as text."""
    hostile = OfflineRun('<script>x</script>', run.result, 1.0)
    html = hostile._repr_html_()
    assert '<img alt="The scene from above' in html and html.count('<tr>') == 3
    assert '<script>' not in html and '&lt;script&gt;' in html
    assert run.state_hash[:12] in html and 'idm' in html
    game = crgame_ros.load_game(CUT_IN)
    assert '&lt;b&gt;' in replace(game, title='<b>')._repr_html_()
    assert repr(run).startswith('<OfflineRun ') and 'av0 (idm), 3.0 s' in repr(run)
    replays = crgame_ros.replay(run, 'constant-velocity', human='trajectory')
    assert replays._repr_html_().count('<tr>') == 1 + 4
    assert replays['constant-velocity'].human_differs_s is None


@pytest.mark.parametrize(('arguments', 'said'), [
    ({'game': 'missing.yaml'}, 'missing.yaml: cannot read'), ({'game': 3}, 'game: is 3'),
    ({'planner': 'missing'}, 'there is no planner "missing"'),
    ({'planner': int}, 'derived from crgame_ros.Planner'),
    ({'planner': ['idm', 'idm']}, 'planner: 2 planners for 1 AVs'),
    ({'planner': 'external'}, 'live runs only'),
    ({'planner': Failing, 'options': {'speed': 1}}, '"speed" is unknown'),
    ({'planner': Failing(), 'options': {'speed': 1}}, 'cannot have options'),
    ({'seed': -1}, 'seed: is -1'), ({'duration_s': -1.0}, 'duration: is -1.0 s'),
    ({'rate_hz': 0.0}, 'rate_hz: '), ({'latency_steps': -1}, 'latency: is -1'),
    ({'driver': 'cockpit'}, 'needs a person'), ({'triggers': {'x': 9.0}}, 'no event "x"'),
    ({'game': CROSSING, 'triggers': {'roadworks': math.nan}}, 'trigger roadworks: is nan s'),
    ({'game': CROSSING, 'triggers': {'roadworks': -1.0}}, 'trigger roadworks: is -1.0 s'),
    ({'problems': [1]}, 'problems: the game names its AVs')])
def test_what_cannot_be_used_is_an_input_error(arguments: dict[str, Any], said: str) -> None:
    """The error is one line with the argument or file and the reason."""
    with pytest.raises(crgame_ros.InputError) as caught:
        crgame_ros.run(**{'game': CUT_IN, 'duration_s': 0.2, **arguments})
    assert said in str(caught.value) and len(str(caught.value).splitlines()) == 1


def test_a_wrong_name_is_answered_with_those_that_there_are(run: OfflineRun) -> None:
    replays = crgame_ros.replay(run, 'idm')
    for look, said in (
            (lambda: run.states_of('av9'), "no driven vehicle 'av9'; there are: hv0, av0"),
            (lambda: run.criticality()['hv1'], "no driven vehicle 'hv1'; there are: hv0, av0"),
            (lambda: run.behaviour()['hv1'], "no driven vehicle 'hv1'; there are: hv0, av0"),
            (lambda: run.scores()[0], 'no driven vehicle 0; there are: hv0, av0'),
            (lambda: run.tables(scores=False)['state'], "no table 'state'; there are: runs, "),
            (lambda: replays['reactive'], "no planner 'reactive'; there are: idm")):
        with pytest.raises(KeyError, match=re.escape(said)):
            look()
    assert run.criticality().get('hv1') is None
    assert pickle.loads(pickle.dumps(run.criticality())) == run.criticality()


def test_refusals_of_what_is_made_of_runs(run: OfflineRun, tmp_path: Path) -> None:
    """Impossible files and runs without the required data are refused."""
    alone = crgame_ros.run(replace(crgame_ros.load_game(CUT_IN), humans=()), duration_s=0.2)
    for attempt, said in (
            (lambda: run.report(tmp_path / 'x.pdf'), 'no name of an HTML file'),
            (lambda: crgame_ros.report([run] * 13, tmp_path / 'x.html'), 'give 12 at most'),
            (lambda: crgame_ros.report([], tmp_path / 'x.html'), 'there is none'),
            (lambda: crgame_ros.export(run, tmp_path, to='xls'), 'give one of parquet, csv'),
            (lambda: crgame_ros.measure(run, requests=['x']), "no event 'x'"),
            (lambda: run.behaviour(['x']), "no event 'x'"),
            (lambda: crgame_ros.read_run(tmp_path / 'none'), 'no such file'),
            (lambda: crgame_ros.replay(alone, 'idm'), 'no human and an AV'),
            (lambda: crgame_ros.replay(run, 'missing'), 'there is no planner'),
            (lambda: crgame_ros.load_game(b'x'), 'give the name of a file')):
        with pytest.raises(crgame_ros.InputError, match=said):
            attempt()
    assert list(tmp_path.iterdir()) == []
