# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A file gets its name only after its content is on the disk."""

import os
from pathlib import Path
import subprocess
import time

from crgame_ros.recording.writer import BagWriter
from crgame_ros.study.session_journal import JOURNAL, SessionJournal
from crgame_ros.whole_file import part_of, whole_folder, write_whole
import pytest


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, frozenset[str]]]:
    """Record each sync to the disk, and the names in its folder at that moment."""
    calls: list[tuple[str, frozenset[str]]] = []
    fsync = os.fsync

    def noted(handle: int) -> None:
        path = Path(os.readlink(f'/proc/self/fd/{handle}'))
        folder = path if path.is_dir() else path.parent
        calls.append((path.name, frozenset(item.name for item in folder.iterdir())))
        fsync(handle)

    monkeypatch.setattr(os, 'fsync', noted)
    return calls


def test_content_then_name_then_folder(
        synced: list[tuple[str, frozenset[str]]], tmp_path: Path) -> None:
    path = tmp_path / 'folder' / 'a.txt'
    path.parent.mkdir()
    for content in (b'old', b'new'):
        write_whole(content, path)
        assert path.read_bytes() == content
    (first, before), (second, after), *_ = synced
    assert first.endswith('.part') and 'a.txt' not in before
    assert second == 'folder' and after == {'a.txt'}
    assert len(synced) == 4


def test_what_cannot_be_written_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / 'a.txt'
    write_whole(b'old', path)
    tmp_path.joinpath(f'.a.txt.{os.getpid()}.part').mkdir()
    with pytest.raises(OSError):
        write_whole(b'new', path)
    assert path.read_bytes() == b'old'


def test_a_folder_is_replaced_once_the_new_one_is_whole(tmp_path: Path) -> None:
    path = tmp_path / 'folder'
    # An earlier process of the same number was killed.
    (part_of(path) / 'folder').mkdir(parents=True)
    for content in ('old', 'new'):
        with whole_folder(path) as part:
            part.mkdir()
            (part / content).touch()
            assert part.name == 'folder' and not (path / content).exists()
    with pytest.raises(ZeroDivisionError), whole_folder(path) as part:
        part.mkdir()
        raise ZeroDivisionError
    assert [item.relative_to(tmp_path).as_posix() for item in tmp_path.rglob('*')] == [
        'folder', 'folder/new']


def test_a_recording_is_on_the_disk_before_its_metadata(
        synced: list[tuple[str, frozenset[str]]], tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag', now_ns=time.monotonic_ns):
        pass
    assert synced[0][0] == 'bag_0.mcap' and 'metadata.yaml' not in synced[0][1]
    assert synced[-1] == ('bag', frozenset({'bag_0.mcap', 'metadata.yaml'}))


def test_a_journal_is_found_again(
        synced: list[tuple[str, frozenset[str]]], tmp_path: Path) -> None:
    with SessionJournal(tmp_path / 'P01') as journal:
        assert ('P01', frozenset({JOURNAL})) in synced
        assert any(name == tmp_path.name and 'P01' in names for name, names in synced)
        synced.clear()
        journal.add({'entry': 'begun'})
        assert [name for name, _ in synced] == [JOURNAL]


def test_what_a_killed_process_has_left_is_removed(tmp_path: Path) -> None:
    """Not what is of another file, or of a process that still writes it."""
    killed = subprocess.Popen(['true'])
    killed.wait()
    left, other, written = (tmp_path / name for name in (
        f'.a.txt.{killed.pid}.part', f'.b.txt.{killed.pid}.part', f'.a.txt.{os.getppid()}.part'))
    for path in (left, other, written):
        path.touch()
    write_whole(b'new', tmp_path / 'a.txt')
    assert [path.exists() for path in (left, other, written)] == [False, True, True]
