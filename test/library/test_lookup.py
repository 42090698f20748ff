# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenarios by their ids, in folders and archives."""

import logging
import os
from pathlib import Path
import shutil
import sys
import tarfile

from crgame_ros.errors import InputError
from crgame_ros.library.lookup import (
    all_ids,
    drop_place,
    find_scenario,
    find_scenarios,
    scenario_of,
    store_place,
)
from crgame_ros.library.stored_index import MAX_BYTES
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from library_files import MERGE, pack, scenario, write  # noqa: E402, I100

OWN = 14
KINDS = ('a.zip', 'a.tar', 'a.tar.gz', 'a.tgz')


def test_a_file_is_found_by_its_name_and_else_by_the_id_in_it(tmp_path: Path) -> None:
    deep = write(tmp_path / 'all' / 'USA' / 'USA_Peach-4_1_T-1.xml')
    other = write(tmp_path / 'all' / 'mine.xml', 'ITA_Own-1_1_T-1')
    interactive = write(tmp_path / 'all' / 'DEU_X-1_1_I-1.cr.xml')
    (tmp_path / 'all' / 'DEU_X-1_1_I-1.net.xml').write_text('<net version="1"/>')
    store_place(tmp_path / 'all')
    assert scenario_of('USA_Peach-4_1_T-1') == deep
    assert scenario_of('ITA_Own-1_1_T-1') == scenario_of('mine') == other
    assert scenario_of('DEU_X-1_1_I-1') == interactive
    # The package's own are found without a place, and what is no scenario does not count.
    assert len(all_ids()) == OWN + 3
    assert scenario_of('ZAM_CutIn-1_1_T-1').read_text().count('benchmarkID="ZAM_CutIn-1_1_T-1"')


def test_what_changes_is_found_whatever_the_clock_of_the_folder_says(tmp_path: Path) -> None:
    """A file that comes or goes within the clock's tick leaves its folder's time as it was."""
    first = write(tmp_path / 'all' / 'USA_A-1_1_T-1.xml')
    store_place(tmp_path / 'all')
    assert scenario_of('USA_A-1_1_T-1') == first
    times = first.parent.stat()
    second = write(tmp_path / 'all' / 'USA_B-1_1_T-1.xml')
    os.utime(first.parent, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert scenario_of('USA_B-1_1_T-1') == second
    moved = first.parent / 'more' / first.name
    moved.parent.mkdir()
    first.rename(moved)
    os.utime(first.parent, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert scenario_of('USA_A-1_1_T-1') == moved
    second.write_bytes(scenario('USA_C-1_1_T-1'))
    assert scenario_of('USA_C-1_1_T-1') == second


def test_the_first_place_wins_and_the_variable_goes_first(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        caplog: pytest.LogCaptureFixture) -> None:
    for name in ('one', 'same', 'other'):
        write(tmp_path / name / 'USA_A-1_1_T-1.xml')
    store_place(tmp_path / 'one')
    store_place(tmp_path / 'same')
    with caplog.at_level(logging.WARNING):
        assert scenario_of('USA_A-1_1_T-1').parent.name == 'one'
        assert not caplog.records
        (tmp_path / 'other' / 'USA_A-1_1_T-1.xml').write_bytes(MERGE)
        monkeypatch.setenv('CRGAME_SCENARIOS', f'{tmp_path / "gone"}:{tmp_path / "other"}')
        assert scenario_of('USA_A-1_1_T-1').parent.name == 'other'
    assert 'of the same id and other content' in caplog.text


@pytest.mark.parametrize('kind', KINDS)
def test_a_scenario_out_of_an_archive_has_a_file_named_by_its_content(
        tmp_path: Path, user: Path, kind: str) -> None:
    members = {f'all/USA_A-1_{number}_T-1.xml': scenario(f'USA_A-1_{number}_T-1')
               for number in range(1, 4)}
    archive = pack(tmp_path / kind, members | {'all/README.md': b'scenarios'})
    store_place(archive)
    for _ in range(2):
        found = scenario_of('USA_A-1_2_T-1')
        assert found.read_bytes() == members['all/USA_A-1_2_T-1.xml']
        assert found.stem == 'USA_A-1_2_T-1' and found.is_relative_to(user / 'cache')
    # The index says where it is; its copy may go.
    shutil.rmtree(found.parent)
    assert scenario_of('USA_A-1_2_T-1') == found and found.is_file()
    pack(archive, members | {'USA_B-1_1_T-1.xml': scenario('USA_B-1_1_T-1')})
    os.utime(archive, ns=(0, 0))
    assert scenario_of('USA_B-1_1_T-1').is_file()
    assert len(all_ids()) == OWN + 4


@pytest.mark.parametrize('kind', KINDS)
def test_names_in_archives_are_no_paths(tmp_path: Path, user: Path, kind: str) -> None:
    evil = f'{"../" * 12}{tmp_path.as_posix().lstrip("/")}/USA_Evil-1_1_T-1.xml'
    store_place(pack(tmp_path / kind, {
        evil: scenario('USA_Evil-1_1_T-1'), f'{tmp_path}/USA_Root-1_1_T-1.xml': MERGE}))
    for name in ('USA_Evil-1_1_T-1', 'USA_Root-1_1_T-1'):
        assert scenario_of(name).is_relative_to(user / 'cache')
    assert not list(tmp_path.glob('*.xml'))


def test_links_and_members_beyond_the_limit_are_no_scenarios(tmp_path: Path) -> None:
    link = tarfile.TarInfo('USA_Link-1_1_T-1.xml')
    link.type, link.linkname = tarfile.SYMTYPE, '/etc/passwd'
    with tarfile.open(tmp_path / 'a.tar.gz', 'w:gz') as archive:
        archive.addfile(link)
    pack(tmp_path / 'bomb.zip', {
        'USA_Bomb-1_1_T-1.xml': b'<commonRoad benchmarkID="USA_Bomb-1_1_T-1">'.ljust(
            MAX_BYTES + 1)})
    for kind in ('unprintable.zip', 'unprintable.tar'):
        pack(tmp_path / kind, {'USA_\x07-1_1_T-1.xml': scenario('USA_Bell-1_1_T-1')})
    for name in ('a.tar.gz', 'bomb.zip', 'unprintable.zip', 'unprintable.tar'):
        store_place(tmp_path / name)
    assert len(all_ids()) == OWN


@pytest.mark.parametrize('kind', KINDS)
def test_a_damaged_archive_is_told_in_one_line(tmp_path: Path, kind: str) -> None:
    archive = pack(tmp_path / kind, {'USA_A-1_1_T-1.xml': scenario('USA_A-1_1_T-1')})
    content = archive.read_bytes()
    store_place(archive)
    for damaged in (b'', b'no archive' * 100, content[:len(content) // 2]):
        archive.write_bytes(damaged)
        with pytest.raises(InputError, match=r'cannot be read as an archive.*remove'):
            all_ids()


def test_a_damaged_index_is_made_again(tmp_path: Path, user: Path) -> None:
    file = write(tmp_path / 'all' / 'USA_A-1_1_T-1.xml')
    store_place(tmp_path / 'all')
    assert scenario_of('USA_A-1_1_T-1') == file
    indexes = list((user / 'cache').rglob('index-*.json'))
    assert len(indexes) == 2
    for damaged in ('{', '[]', '{"format": 0}'):
        for index in indexes:
            index.write_text(damaged)
        assert scenario_of('USA_A-1_1_T-1') == file


def test_an_unknown_id_is_answered_with_the_nearest(tmp_path: Path) -> None:
    for number in (1, 2, 30):
        write(tmp_path / 'all' / f'USA_US101-{number}_1_T-1.xml')
    store_place(tmp_path / 'all')
    with pytest.raises(InputError, match=(
            r'^usa_us101-3_1_t-1: is no file, and none of the 17 known scenarios; '
            r'did you mean .*USA_US101-30_1_T-1.*\? .*crgame scenarios add DIR$')):
        scenario_of('usa_us101-3_1_t-1')
    drop_place(tmp_path / 'all')
    with pytest.raises(InputError, match='none of the 14 known scenarios; name a folder'):
        scenario_of('USA_Somewhere-1_1_T-1')


def test_files_go_before_ids_and_patterns_stand_for_many(tmp_path: Path) -> None:
    place = tmp_path / 'all'
    files = [write(place / f'USA_A-{number}_1_T-1.xml') for number in (1, 2)]
    store_place(place)
    here = tmp_path / 'USA_A-1_1_T-1'
    here.mkdir()
    assert find_scenario(here.name, tmp_path) == here
    assert find_scenario('missing.xml', tmp_path) == tmp_path / 'missing.xml'
    assert find_scenario('USA_A-2_1_T-1', tmp_path) == files[1]
    assert find_scenarios(['USA_A-*', 'some/folder'], place) == (*map(str, files), 'some/folder')
    ids = [path.stem for path in reversed(files)]
    assert find_scenarios([*ids, ids[0]]) == (str(files[1]), str(files[0]), str(files[1]))
    with pytest.raises(InputError, match='USA_B-1_1_T-1'):
        find_scenarios([*ids, 'USA_B-1_1_T-1'])
    with pytest.raises(InputError, match='no scenario has an id like this'):
        find_scenarios(['BEL_*'])
