# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Past runs over HTTP: list, details, downloads, comparison, replay and deletion."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import asdict
import io
import json
from pathlib import Path
import shutil
from types import SimpleNamespace
from typing import Any, cast
import zipfile

from aiohttp import ClientSession, CookieJar, WSMsgType
from cockpit_support import HOST, in_loop, PATIENCE_S, PumpBackend
from crgame_ros.analysis.scores.scored_run import scores_of
from crgame_ros.cockpit.access import Access
from crgame_ros.cockpit.runs import routes
from crgame_ros.cockpit.runs.archive import PastRun, run_id, RunArchive
from crgame_ros.cockpit.runs.jobs import score
from crgame_ros.cockpit.runs.routes import add_run_routes
from crgame_ros.cockpit.server import create_app, listen
from crgame_ros.errors import InputError
from crgame_ros.game.events import FiredEvent
from crgame_ros.recording.run_record import read_run_record
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.vehicle.state import StateColumn
import numpy as np
import pytest
from replay_support import drive, PARKED, plans, record, recorder, samples, START

HEADER = {'X-Crgame': '1'}
TITLE = '<b>Parked</b>\u202e'


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a run of 4 s once."""
    result = drive(PARKED, 4.0)
    return record(tmp_path_factory.mktemp('run') / 'bag',
                  [*recorder.messages(result), *plans(result)])


def make_run(folder: Path, bag: Path) -> Path:
    """Write a finished run into a folder."""
    shutil.copytree(bag, folder / 'bag')
    (folder / 'game.yaml').write_text(json.dumps(
        {'scenario': str(folder / 'x.xml'), 'title': TITLE}))
    (folder / 'timing.json').write_text(json.dumps({'contacts': [{}, {}]}))
    (folder / 'report.html').write_text('<script>ran = true</script>')
    return folder


class Runs:
    """A listening server with an archive, and a client of it."""

    def __init__(self, archive: RunArchive, http: ClientSession, address: str) -> None:
        self.archive, self.http, self.address = archive, http, address

    async def get(self, path: str, **query: str) -> tuple[int, bytes, dict[str, str]]:
        async with self.http.get(f'{self.address}{path}', params=query) as answer:
            return answer.status, await answer.read(), dict(answer.headers)

    async def json(self, path: str, **query: str) -> Any:
        return json.loads((await self.get(path, **query))[1])

    async def delete(self, key: Any) -> tuple[int, dict[str, Any]]:
        async with self.http.post(f'{self.address}/api/runs/delete', json={'id': key},
                                  headers=HEADER) as answer:
            return answer.status, await answer.json()


@asynccontextmanager
async def serving(session: Path, root: Path | None = None) -> AsyncIterator[Runs]:
    archive = RunArchive(session, root)
    app = create_app(PumpBackend(), Access(HOST, 0, None), None)
    add_run_routes(app, archive, session / 'cockpit')
    runner, port = await listen(app, HOST, 0)
    try:
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as http:
            yield Runs(archive, http, f'http://{HOST}:{port}')
    finally:
        await runner.cleanup()


@in_loop
async def test_runs_are_listed_scored_drawn_and_sent(tmp_path: Path, bag: Path) -> None:
    session = make_run(tmp_path / 'runs' / 'now', bag)
    make_run(session / 'run_2', bag)
    make_run(tmp_path / 'runs' / 'before', bag)
    (tmp_path / 'runs' / 'other' / 'bag').mkdir(parents=True)
    (tmp_path / 'runs' / 'link').symlink_to(tmp_path / 'runs' / 'before')
    async with serving(session, tmp_path / 'runs') as running:
        text = (await running.get('/api/runs'))[1].decode()
        runs = json.loads(text)['runs']
        assert [run['name'] for run in runs] == ['now/run_2', 'now', 'before']
        assert runs[0]['id'] == run_id(session / 'run_2') and str(tmp_path) not in text
        assert {run['title'] for run in runs} == {'bParked/b'}
        assert [run['contacts'] for run in runs] == [2, 2, 2]
        # A recorder's first message is at 0 s, the last one 4 s later.
        assert runs[0]['duration_s'] == pytest.approx(4.0, abs=0.2)
        assert {item['name'] for item in runs[0]['files']} >= {
            'game.yaml', 'bag/metadata.yaml', 'timing.json', 'report.html'}
        score = await running.json('/api/runs/score', id=runs[0]['id'])
        status, picture, headers = await running.get('/api/runs/picture', id=runs[0]['id'])
        assert status == 200 and headers['Content-Type'] == 'image/svg+xml'
        assert picture.startswith(b'<svg') and b'hv0' in picture
        name = next(item['name'] for item in runs[0]['files'] if item['name'].endswith('.mcap'))
        _, sent, headers = await running.get('/api/runs/file', id=runs[0]['id'], file=name)
        assert sent == (session / 'run_2' / name).read_bytes()
        assert 'attachment' in headers['Content-Disposition']
        _, packed, _ = await running.get('/api/runs/zip', id=runs[0]['id'])
        status, _, headers = await running.get(
            '/api/runs/file', id=runs[0]['id'], file='report.html')
        assert status == 200 and headers['Content-Security-Policy'].startswith('sandbox ')
    expected = scores_of(read_run_record(bag), {}, drives_only=True)
    for told, found in zip(score['vehicles'], expected.vehicles, strict=True):
        assert found.nuplan is not None and told['vehicle'] == found.vehicle_id
        assert told['score'] == pytest.approx(found.nuplan.score)
        assert {part['weight'] for part in told['parts']} == {0.0, 2.0, 4.0, 5.0}
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        assert archive.testzip() is None
        assert archive.read(f'now_run_2/{name}') == sent
        assert len(archive.namelist()) == len(runs[0]['files'])


def test_the_jump_of_a_put_back_is_no_distance(tmp_path: Path) -> None:
    """The page shows the distance that tables and reports show."""
    result = drive(PARKED, 4.0)
    fired = asdict(FiredEvent.put_back('hv0', 205, 20))
    bag = record(tmp_path / 'bag', [*recorder.messages(result), (
        '/scenario/events', 'std_msgs/msg/String', START + 2_051_000_000,
        samples.string(json.dumps({'epoch': 0, 'fired': [fired]})))])
    log = read_trajectories(bag)
    steps = np.hypot(*np.diff(log.vehicle_states[:, 0, :2], axis=0).T)
    vehicles = {each['vehicle']: each for each in cast(Any, score(bag)['vehicles'])}
    assert steps[20:22].min() > 0.01
    assert vehicles['hv0']['distance'] == pytest.approx(steps.sum() - steps[20:22].sum())
    assert vehicles['hv0']['fastest'] == log.vehicle_states[:, 0, StateColumn.SPEED].max()


@in_loop
async def test_nothing_beside_the_files_of_a_run_is_sent(tmp_path: Path, bag: Path) -> None:
    session = make_run(tmp_path / 'now', bag)
    (tmp_path / 'secret').write_text('secret')
    (session / 'bag' / 'secret.mcap').symlink_to(tmp_path / 'secret')
    (session / 'private.txt').write_text('secret')
    key = run_id(session)
    async with serving(session) as running:
        for name in ('../secret', 'bag/../../secret', 'bag/secret.mcap', 'private.txt',
                     '/etc/passwd', str(session / 'game.yaml'), ''):
            status, body, _ = await running.get('/api/runs/file', id=key, file=name)
            assert status == 400 and b'secret' not in body, name
        for wanted in ('..', '../secret', str(session), 'x' * 5000, ''):
            assert (await running.get('/api/runs/zip', id=wanted))[0] == 400
            assert (await running.delete(wanted))[0] == 400
        assert (await running.get('/api/runs/comparison', ids=f'{key},{key}'))[0] == 400
        packed = (await running.get('/api/runs/zip', id=key))[1]
    assert b'secret' not in packed


@in_loop
async def test_only_runs_that_are_over_are_deleted_and_only_their_own_files(
        tmp_path: Path, bag: Path) -> None:
    session = make_run(tmp_path / 'runs' / 'now', bag)
    (session / '.started').touch()
    for name in ('run_2', 'run_3'):
        make_run(session / name, bag)
        (session / name / '.finished').touch()
    (session / '.finished').touch()
    (session / 'run_3' / '.finished').unlink()
    (session / 'run_2' / 'notes.txt').write_text('mine')
    other = make_run(tmp_path / 'runs' / 'other', bag)
    async with serving(session, tmp_path / 'runs') as running:
        status, content = await running.delete(run_id(session / 'run_3'))
        assert status == 400 and 'is being recorded' in content['error']
        assert (session / 'run_3' / 'game.yaml').is_file()
        for folder in (session / 'run_2', session, other):
            status, content = await running.delete(run_id(folder))
            assert status == 200 and 'is deleted' in content['text']
        names = [run['name'] for run in (await running.json('/api/runs'))['runs']]
    assert names == ['now/run_3']
    assert not other.exists()
    # Foreign files stay, as do the session and its other runs.
    assert [path.name for path in (session / 'run_2').iterdir()] == ['notes.txt']
    assert {path.name for path in session.iterdir()} == {'.started', 'run_2', 'run_3'}


def test_runs_are_listed_again_only_for_one_that_is_not_known(tmp_path: Path, bag: Path) -> None:
    session = make_run(tmp_path / 'now', bag)
    archive = RunArchive(session)
    first = archive.run(run_id(session))
    assert archive.run(first.id) is first
    later = make_run(session / 'run_2', bag)
    assert archive.run(run_id(later)).folder == later
    shutil.rmtree(later)
    with pytest.raises(InputError, match='there is no such run'):
        archive.run(run_id(later))


@in_loop
async def test_a_replay_that_died_is_ended_before_it_begins_again(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its standard input is closed, and no living replay has to make room for it."""
    began, ended = list[str](), list[str]()

    async def start(run: PastRun) -> Any:
        began.append(run.id)
        return SimpleNamespace(process=SimpleNamespace(returncode=None, run=run.id))

    async def end(process: Any) -> None:
        ended.append(process.run)

    monkeypatch.setattr(routes, '_start', start)
    monkeypatch.setattr(routes, 'end_module', end)
    replays = routes.RunReplays()
    runs = [PastRun(str(number), tmp_path, tmp_path) for number in range(routes.MOST_REPLAYS)]
    for run in runs:
        found = await replays._replay(run)
    cast(Any, found.process).returncode = -9
    await replays._replay(runs[-1])
    assert began == ['0', '1', '2', '2'] and ended == ['2']
    assert await replays._replay(runs[-1]) is not found and len(began) == 4
    await replays.close()
    assert sorted(ended) == ['0', '1', '2', '2']


@pytest.mark.exhaustive
@in_loop
async def test_runs_are_compared_and_shown_again(tmp_path: Path, bag: Path) -> None:
    session = make_run(tmp_path / 'now', bag)
    make_run(session / 'run_2', bag)
    keys = [run_id(session), run_id(session / 'run_2')]
    async with serving(session) as running:
        status, page, headers = await running.get('/api/runs/comparison', ids=','.join(keys))
        assert status == 200 and b'now/run_2' in page
        assert "default-src 'none'" in headers['Content-Security-Policy']
        status, page, _ = await running.get(f'/replay/{keys[1]}/')
        assert status == 200 and b'<canvas id="world"' in page
        info = await running.json(f'/replay/{keys[1]}/api/replay/info')
        assert info['duration_s'] == pytest.approx(4.0, abs=0.11)
        chunk = (await running.get(f'/replay/{keys[1]}/api/replay/chunk', i='0'))[1]
        assert len(chunk) > 1000
        async with running.http.ws_connect(f'{running.address}/replay/{keys[1]}/ws') as socket:
            hello = json.loads((await socket.receive(timeout=PATIENCE_S)).data)
            assert (hello['type'], hello['mode']) == ('hello', 'replay')
            await socket.send_json({'type': 'ping', 't': 1})
            while (message := await socket.receive(timeout=PATIENCE_S)).type is WSMsgType.TEXT:
                if json.loads(message.data)['type'] == 'pong':
                    break
            assert message.type is WSMsgType.TEXT
        assert (await running.delete(keys[1]))[0] == 200
        assert (await running.get(f'/replay/{keys[1]}/'))[0] == 400
