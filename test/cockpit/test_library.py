# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The library over HTTP: the list, previews of games, uploads and choices."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
import math
from pathlib import Path
import shutil
import signal
from typing import Any

from cockpit_support import Cockpit, cockpit, get, in_loop, PATIENCE_S
from crgame_ros.cockpit import library as library_module
from crgame_ros.cockpit.job_process import JobProcess
from crgame_ros.cockpit.library import Library, READER
from crgame_ros.cockpit.shown_paths import without_paths
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.setup import build_setup
import pytest
import yaml

HEADER = {'X-Crgame': '1'}
SCENARIOS = scenarios_directory()
CUT_IN = (SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml').read_bytes()
BOMB = (b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a "aaaaaaaaaa">'
        + b''.join(b'<!ENTITY %c "&%c;&%c;&%c;&%c;">' % (b + 1, b, b, b, b)
                   for b in range(97, 117))
        + b']><commonRoad>&u;</commonRoad>')
OUTSIDE = (b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
           b'<commonRoad>&x;</commonRoad>')


@asynccontextmanager
async def with_library(folder: Path, **options: Any) -> AsyncIterator[Cockpit]:
    library = Library([('Own', SCENARIOS)], folder / 'uploads', folder / 'games', **options)
    async with cockpit(library=library) as running:
        yield running


async def listed(running: Cockpit) -> dict[str, Any]:
    async with running.http.get(f'{running.address}/api/scenarios') as answer:
        content: dict[str, Any] = await answer.json()
        return content


async def entry(running: Cockpit, name: str) -> str:
    """Return the id of the entry with a file name."""
    return next(str(item['id']) for folder in (await listed(running))['folders']
                for item in folder['entries'] if item['name'] == name)


async def preview(running: Cockpit, entry_id: str) -> tuple[int, dict[str, Any]]:
    async with running.http.get(f'{running.address}/api/preview',
                                params={'id': entry_id}) as answer:
        return answer.status, await answer.json()


async def upload(running: Cockpit, data: bytes, **query: str) -> tuple[int, dict[str, Any]]:
    async with running.http.post(f'{running.address}/api/upload', data=data, params=query,
                                 headers=HEADER) as answer:
        return answer.status, await answer.json()


async def delete(running: Cockpit, entry_id: Any) -> tuple[int, dict[str, Any]]:
    async with running.http.post(f'{running.address}/api/upload/delete', json={'id': entry_id},
                                 headers=HEADER) as answer:
        return answer.status, await answer.json()


async def planner(running: Cockpit, name: str) -> tuple[int, dict[str, Any]]:
    async with running.http.get(f'{running.address}/api/planner', params={'name': name}) as answer:
        return answer.status, await answer.json()


async def load(running: Cockpit, **choice: Any) -> tuple[int, dict[str, Any]]:
    async with running.http.post(f'{running.address}/api/load', json=choice,
                                 headers=HEADER) as answer:
        return answer.status, await answer.json()


@in_loop
async def test_games_and_scenarios_are_listed_and_timelines_are_not(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        content = await listed(running)
    assert [folder['name'] for folder in content['folders']] == ['Own', 'Uploads']
    entries = {item['name']: item for item in content['folders'][0]['entries']}
    assert entries['cut_in.yaml']['kind'] == 'game'
    assert entries['cut_in.yaml']['title'] == load_game(SCENARIOS / 'cut_in.yaml').title
    assert entries['ZAM_CutIn-1_1_T-1.xml']['kind'] == 'scenario'
    assert entries['ZAM_CutIn-1_1_T-1.xml']['title'] == 'ZAM_CutIn-1_1_T-1'
    assert not [name for name in entries if name.endswith(('.keys.yaml', '.joy.yaml'))]
    assert 'idm' in content['planners'] and content['drivers'] == ['auto', 'cockpit', 'idle']
    assert str(SCENARIOS) not in str(content)


@in_loop
async def test_a_preview_shows_the_scene_and_where_everything_starts(tmp_path: Path) -> None:
    setup = build_setup(load_game(SCENARIOS / 'cut_in.yaml'))
    async with with_library(tmp_path) as running:
        status, content = await preview(running, await entry(running, 'cut_in.yaml'))
    assert status == 200
    assert content['scene']['benchmark_id'] == setup.loaded.benchmark_id
    assert [vehicle['id'] for vehicle in content['scene']['vehicles']] == ['hv0', 'av0']
    # States are those of the run's first step: CRG 6-10 places the AV, the game the human.
    for row, vehicle in zip(content['states']['vehicles'], setup.vehicles, strict=True):
        assert row == [*vehicle.state, None, None, None, None]
    poses = setup.obstacles.states_at(setup.scheduler.k0).poses
    assert len(content['states']['objects']) == len(poses) == len(content['scene']['objects'])
    for row, pose in zip(content['states']['objects'], poses.tolist(), strict=True):
        assert row[:3] == [None if math.isnan(value) else value for value in pose]
    assert content['humans'] == [
        {'id': human.id, 'driver': without_paths(human.driver)} for human in setup.humans]
    assert content['humans'][0]['driver'] == 'keys:cut_in.keys.yaml'
    assert content['avs'] == [
        {'id': 'av0', 'planner': setup.avs[0].spec.planner,
         'planning_problem': setup.avs[0].planning_problem.planning_problem_id,
         'options': {}}]


@pytest.mark.exhaustive
@in_loop
async def test_every_listed_entry_can_be_previewed(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        entries = (await listed(running))['folders'][0]['entries']
        found = {item['name']: (await preview(running, item['id']))[0] for item in entries}
    assert found and set(found.values()) == {200}, found


@in_loop
async def test_only_ids_of_the_list_lead_to_files(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        for name in ('', '/etc/passwd', '../cut_in.yaml', 'cut_in.yaml',
                     str(SCENARIOS / 'cut_in.yaml'), 'x' * 5000, '\x00'):
            status, content = await preview(running, name)
            assert (status, content) == (
                400, {'error': 'id: there is no such scenario; load the page again'})


@in_loop
async def test_a_game_that_cannot_be_used_says_why_without_naming_folders(
        tmp_path: Path) -> None:
    (tmp_path / 'own').mkdir()
    (tmp_path / 'own' / 'bad.yaml').write_text('scenario: missing.xml\n')
    library = Library([('Own', tmp_path / 'own')], tmp_path / 'up', tmp_path / 'games')
    async with cockpit(library=library) as running:
        status, content = await preview(running, await entry(running, 'bad.yaml'))
    assert status == 400
    assert 'missing.xml' in content['error'] and str(tmp_path) not in content['error']


@in_loop
async def test_an_upload_is_kept_listed_and_previewed(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        status, content = await upload(
            running, CUT_IN, name='<script>alert("é")</script>\n../../my file')
        assert status == 200
        item = (await listed(running))['folders'][1]['entries'][0]
        assert item['id'] == content['id'] and item['kind'] == 'upload'
        assert item['title'] == 'scriptalert("é")/script ../../my file'
        assert (await preview(running, content['id']))[0] == 200
        # The same file again is the same entry.
        assert await upload(running, CUT_IN) == (200, content)
    # The server chose its name.
    assert [path.name for path in (tmp_path / 'uploads').iterdir()] == [item['name']]
    assert (tmp_path / 'uploads' / item['name']).read_bytes() == CUT_IN
    # The next server finds it under its benchmark id.
    async with with_library(tmp_path) as running:
        item = (await listed(running))['folders'][1]['entries'][0]
        assert (item['id'], item['title']) == (content['id'], 'ZAM_CutIn-1_1_T-1')


@in_loop
async def test_uploads_and_nothing_else_are_deleted(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        _, content = await upload(running, CUT_IN)
        own = await entry(running, 'cut_in.yaml')
        for wanted in (own, '', '../x', 7):
            assert (await delete(running, wanted))[0] == 400
        assert (await load(running, id=content['id']))[0] == 200
        status, answer = await delete(running, content['id'])
        assert status == 400 and 'of the present run' in answer['error']
        # A game that the simulation refuses is not the present one.
        running.backend.load_refusal = 'the simulation does not answer'
        assert (await load(running, id=own))[0] == 400
        assert (await delete(running, content['id']))[0] == 400
        running.backend.load_refusal = ''
        assert (await load(running, id=own))[0] == 200
        assert (await delete(running, content['id']))[0] == 200
        assert (await listed(running))['folders'][1]['entries'] == []
    assert list((tmp_path / 'uploads').iterdir()) == []


@pytest.mark.exhaustive
@in_loop
async def test_an_abandoned_preview_is_ended(tmp_path: Path) -> None:
    reader = JobProcess(READER, 'scenario')
    async with with_library(tmp_path, reader=reader) as running:
        first = await entry(running, 'cut_in.yaml')
        assert (await preview(running, first))[0] == 200
        process = reader._process
        assert process is not None
        process.send_signal(signal.SIGSTOP)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.5):
                await preview(running, first)
        # Its page has gone: the next request need not wait for the timeout.
        assert (await preview(running, await entry(running, 'roundabout.yaml')))[0] == 200
    assert process.returncode is not None


BAD = {'nothing': b'', 'no XML': b'hello', 'HTML': b'<html><script>1</script></html>',
       'entity bomb': BOMB, 'outside entity': OUTSIDE, 'cut off': CUT_IN[:2000],
       'no text': b'\x00\xff' * 500, 'gzip': b'\x1f\x8b\x08' + bytes(50),
       'deep': b'<commonRoad>' + b'<a>' * 100_000,
       'NaN': CUT_IN.replace(b'<x>', b'<x>nan', 1)}


@in_loop
async def test_what_is_no_scenario_is_refused_in_one_line_and_not_kept(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        for name, data in BAD.items():
            status, content = await upload(running, data)
            assert status == 400, name
            assert content['error'].startswith('upload') and '\n' not in content['error'], name
            assert len(content['error']) < 300 and str(tmp_path) not in content['error']
            assert 'root:' not in content['error']
    assert not list((tmp_path / 'uploads').iterdir())


@in_loop
async def test_an_upload_that_is_too_large_is_refused_before_it_is_read(tmp_path: Path) -> None:
    async with with_library(tmp_path, max_upload_bytes=10_000) as running:
        promised = await get(running.port, '/api/upload', 'X-Crgame: 1',
                             f'Content-Length: {10 ** 12}', method='POST')
        assert promised[0] == 413 and b'"error"' in promised[1]

        async def endless() -> AsyncIterator[bytes]:
            for _ in range(1000):
                yield bytes(1000)

        async with running.http.post(f'{running.address}/api/upload', data=endless(),
                                     headers=HEADER) as answer:
            assert answer.status == 413
        assert (await upload(running, bytes(10_001)))[0] == 413
    assert not (tmp_path / 'uploads').exists()


@in_loop
async def test_no_more_uploads_are_kept_than_agreed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library_module, 'MAX_UPLOADS', 2)
    async with with_library(tmp_path) as running:
        found = [await upload(running, CUT_IN + b'\n' * number) for number in range(3)]
    assert [status for status, _ in found] == [200, 200, 400]
    assert found[2][1]['error'].startswith('2 uploads are kept already')


@in_loop
async def test_a_choice_becomes_a_game_that_the_backend_is_given(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        status, content = await load(
            running, id=await entry(running, 'cut_in.yaml'),
            humans=[{'id': 'hv0', 'driver': 'cockpit'}],
            avs=[{'id': 'av0', 'planner': 'constant-velocity'}])
        assert (status, content) == (200, {'ok': True, 'text': 'loaded'})
        path = running.backend.games[0]
    assert path.parent == tmp_path / 'games'
    chosen, own = load_game(path), load_game(SCENARIOS / 'cut_in.yaml')
    assert chosen.humans[0].driver == 'cockpit'
    assert chosen.avs is not None and chosen.avs[0].planner == 'constant-velocity'
    # The rest is unchanged, and its scenario is found from any folder.
    assert (chosen.title, chosen.seed, chosen.humans[0].spawn, chosen.timing) == (
        own.title, own.seed, own.humans[0].spawn, own.timing)
    assert build_setup(chosen).loaded.xml_text.encode() == CUT_IN


@in_loop
async def test_a_planner_tells_its_options_and_is_given_those_that_are_typed(
        tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        status, content = await planner(running, 'idm')
        assert status == 200
        options = {option['name']: option for option in content['options']}
        assert options['time_headway'] | {'meaning': ''} == {
            'name': 'time_headway', 'wanted': 'a number', 'default': '1.5', 'meaning': ''}
        assert '[s]' in options['time_headway']['meaning']
        game = await entry(running, 'cut_in.yaml')
        status, _ = await load(running, id=game, avs=[
            {'id': 'av0', 'planner': 'idm', 'options': {'time_headway': '2.5'}}])
        assert status == 200
        avs = load_game(running.backend.games[0]).avs
        assert avs is not None and avs[0].options == {'time_headway': 2.5}
        for typed, told in (
                ({'time_headway': 'long'}, 'av0: options of planner idm: "time_headway"'),
                ({'tyme_gap': '2'}, '"tyme_gap" is unknown'),
                ({'time_headway': '{'}, 'av0: time_headway:'), ([], 'something other'),
                ({'time_headway': 2}, 'misses a text')):
            status, content = await load(running, id=game, avs=[
                {'id': 'av0', 'planner': 'idm', 'options': typed}])
            assert status == 400 and told in content['error'], content
        assert len(running.backend.games) == 1


@in_loop
async def test_no_code_is_asked_for_its_options(tmp_path: Path) -> None:
    evil, mark = tmp_path / 'evil.py', tmp_path / 'ran'
    evil.write_text(f'open({str(mark)!r}, "w")\nclass P: pass\n')
    async with with_library(tmp_path) as running:
        for name in (f'{evil}:P', 'os:system', 'crgame_ros.planner.idm:IdmPlanner', '', '\x00'):
            status, content = await planner(running, name)
            assert status == 400 and 'cannot be chosen here' in content['error']
    assert not mark.exists()


@in_loop
async def test_an_upload_can_be_driven_with_its_own_choice_left_alone(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        _, content = await upload(running, CUT_IN)
        status, _ = await load(running, id=content['id'])
        assert status == 200
        game = load_game(running.backend.games[0])
    assert [human.driver for human in game.humans] == ['cockpit']
    assert game.avs is not None and [av.planner for av in game.avs] == ['idm']


@in_loop
async def test_no_code_and_no_file_of_this_machine_can_be_chosen(tmp_path: Path) -> None:
    mark = tmp_path / 'ran'
    evil = tmp_path / 'evil.py'
    evil.write_text(f'open({str(mark)!r}, "w")\nclass P: pass\n')
    async with with_library(tmp_path) as running:
        game = await entry(running, 'cut_in.yaml')
        for planner in (f'{evil}:P', 'os:system', 'crgame_ros.planner.idm:IdmPlanner', 'nobody'):
            status, content = await load(running, id=game, avs=[{'id': 'av0', 'planner': planner}])
            assert status == 400 and 'planner cannot be chosen' in content['error']
        for driver in ('keys:/etc/passwd', 'replay:/tmp', 'evdev', 'joy', ''):
            status, content = await load(running, id=game,
                                         humans=[{'id': 'hv0', 'driver': driver}])
            assert status == 400 and 'driver cannot be chosen' in content['error']
        for vehicles in ([{'id': 'hv9', 'driver': 'idle'}], [{'id': 'av0', 'driver': 'idle'}],
                         [4], 'all', [{}], [{'id': 'hv0'}], [{'id': [], 'driver': 'idle'}]):
            assert (await load(running, id=game, humans=vehicles))[0] == 400, vehicles
        assert not running.backend.games
    assert not mark.exists() and not (tmp_path / 'games').exists()


@in_loop
async def test_what_is_no_choice_is_refused(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        for body in (b'', b'{', b'[]', b'{}', b'{"id": 4}', b'[' * 100_000, b'\xff'):
            async with running.http.post(f'{running.address}/api/load', data=body,
                                         headers=HEADER) as answer:
                assert answer.status == 400 and 'error' in await answer.json(), body
        async with running.http.post(f'{running.address}/api/load', data=b' ' * 300_000,
                                     headers=HEADER) as answer:
            assert answer.status == 413


@pytest.mark.clock
@in_loop
async def test_frames_go_on_while_a_scenario_is_read(tmp_path: Path) -> None:
    async with with_library(tmp_path) as running:
        game = await entry(running, 'roundabout.yaml')
        reading = asyncio.create_task(preview(running, game))
        loop = asyncio.get_running_loop()
        longest_s, begin_s = 0.0, loop.time()
        while not reading.done():
            start_s = loop.time()
            await asyncio.sleep(0.01)
            longest_s = max(longest_s, loop.time() - start_s)
        assert (await reading)[0] == 200
        # Reading in the event loop would make one gap: a driver's keys would wait.
        assert longest_s < 0.5 * (loop.time() - begin_s)


@pytest.mark.exhaustive
@in_loop
async def test_a_scenario_that_takes_too_long_is_given_up_and_the_next_is_read(
        tmp_path: Path) -> None:
    reader = JobProcess(READER, 'scenario')
    async with with_library(tmp_path, reader=reader) as running:
        first = await entry(running, 'cut_in.yaml')
        second = await entry(running, 'roundabout.yaml')
        assert (await preview(running, first))[0] == 200
        reader._timeout_s = 0.001
        status, content = await preview(running, first)
        assert status == 400 and 'takes more than 0.001 s to read' in content['error']
        # An abandoned answer is not taken for the answer to the next request.
        reader._timeout_s = PATIENCE_S
        _, content = await preview(running, second)
        assert content['scene']['benchmark_id'] == 'ZAM_Roundabout-1_1_T-1'


@in_loop
async def test_a_reader_that_dies_is_replaced(tmp_path: Path) -> None:
    reader = JobProcess(READER, 'scenario')
    async with with_library(tmp_path, reader=reader) as running:
        game = await entry(running, 'cut_in.yaml')
        assert (await preview(running, game))[0] == 200
        assert reader._process is not None
        reader._process.kill()
        await reader._process.wait()
        assert (await preview(running, game))[0] == 200
        process = reader._process
    assert process.returncode is not None


@in_loop
async def test_a_cockpit_without_library_says_so(tmp_path: Path) -> None:
    async with cockpit() as running:
        for path in ('scenarios', 'preview'):
            async with running.http.get(f'{running.address}/api/{path}') as answer:
                assert answer.status == 404 and 'nothing to choose' in await answer.text()
        assert (await upload(running, CUT_IN))[0] == 404


@in_loop
async def test_a_folder_that_is_gone_or_holds_anything_is_no_error(tmp_path: Path) -> None:
    own = tmp_path / 'own'
    shutil.copytree(SCENARIOS, own / 'sub')
    (own / 'list.yaml').write_text('- 1\n')
    (own / 'broken.yaml').write_text('{')
    (own / 'other.yaml').write_text('title: no scenario\n')
    (own / 'title.yaml').write_text(yaml.safe_dump(
        {'scenario': 'x.xml', 'title': '<b>Title</b>\u202e' + 'x' * 200}))
    (own / 'empty.xml').write_text('')
    library = Library([('Own', own), ('Gone', tmp_path / 'gone')], tmp_path / 'u', tmp_path / 'g')
    async with cockpit(library=library) as running:
        folders = {item['name']: item['entries'] for item in (await listed(running))['folders']}
    assert folders['Gone'] == []
    assert [(item['name'], item['kind']) for item in folders['Own']] == [
        ('empty.xml', 'scenario'), ('title.yaml', 'game')]
    assert folders['Own'][0]['title'] == 'empty'
    assert folders['Own'][1]['title'] == ('bTitle/b' + 'x' * 80)[:80]


@in_loop
async def test_a_scenario_that_takes_much_of_the_processor_is_given_up(tmp_path: Path) -> None:
    """Its process is ended together with its data; another process reads the next scenario."""
    (tmp_path / 'slow.py').write_text(
        'from crgame_ros.cockpit.job_process import serve_jobs\n'
        'def spin(path):\n'
        '    while True:\n'
        '        sum(range(1000))\n'
        "serve_jobs({'spin': spin, 'name': lambda path: {'name': path.name}}, 'scenario',"
        ' 0.2)\n')
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PYTHONPATH', str(tmp_path))
        reader = JobProcess('slow', 'scenario')
        await reader.start()
        given_up = reader._process
        with pytest.raises(InputError, match=r'takes more than 0\.2 s to read'):
            await reader.run('spin', path='/x')
        assert given_up is not None and given_up.returncode is not None
        assert await reader.run('name', path='/a/b.xml') == b'{"name":"b.xml"}'
        await reader.close()


@in_loop
async def test_who_ends_a_server_waits_for_the_process_of_a_cancelled_job(tmp_path: Path) -> None:
    """The loop is closed afterwards, when nobody could take note of the process's end."""
    (tmp_path / 'endless.py').write_text(
        'import time\n'
        'from crgame_ros.cockpit.job_process import serve_jobs\n'
        "serve_jobs({'wait': lambda path: time.sleep(1e3)}, 'scenario')\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PYTHONPATH', str(tmp_path))
        reader = JobProcess('endless', 'scenario')
        await reader.start()
        process = reader._process
        job = asyncio.create_task(reader.run('wait', path='/x'))
        await asyncio.sleep(0.1)
        job.cancel()
        # It begins to end the process here.
        await asyncio.sleep(0)
        await reader.close()
        assert process is not None and process.returncode is not None
        with pytest.raises(asyncio.CancelledError):
            await job
