# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Videos last as long as the run, one picture for each scenario step."""

from dataclasses import replace
import os
from pathlib import Path

from crgame_ros.analysis.pictures import run_video
from crgame_ros.analysis.pictures.run_video import write_video
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.errors import InputError
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from matplotlib.animation import FFMpegWriter
from PIL import Image
import pytest


def _short(record: RunRecord, rows: int) -> RunTrajectories:
    log = record.log
    return replace(log, ks=log.ks[:rows], vehicle_states=log.vehicle_states[:rows],
                   object_poses=log.object_poses[:rows],
                   object_velocities=log.object_velocities[:rows])


def test_a_gif_lasts_as_long_as_the_run(cut_in: RunRecord, tmp_path: Path) -> None:
    """Eight steps of 0.1 s; the same bytes again; nothing else is left in the folder."""
    shares: list[float] = []
    for name in ('a.gif', 'b.gif'):
        log = _short(cut_in, 8)
        assert write_video(FrameScene(log), tmp_path / name, shares.append) == tmp_path / name
    assert shares[:8] == pytest.approx([i / 8 for i in range(1, 9)])
    assert (tmp_path / 'a.gif').read_bytes() == (tmp_path / 'b.gif').read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {'a.gif', 'b.gif'}
    with Image.open(tmp_path / 'a.gif') as film:
        durations = []
        for number in range(film.n_frames):
            film.seek(number)
            durations.append(film.info['duration'])
        assert sum(durations) == 800 and film.size[0] == 720


def test_without_ffmpeg_it_is_a_gif(cut_in: RunRecord, tmp_path: Path,
                                    monkeypatch: pytest.MonkeyPatch) -> None:
    """It has the same name but for the suffix."""
    monkeypatch.setattr(run_video.FFMpegWriter, 'isAvailable', classmethod(lambda cls: False))
    written = write_video(FrameScene(_short(cut_in, 2)), tmp_path / 'run.mp4')
    assert written == tmp_path / 'run.gif' and written.is_file()


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason='ffmpeg is not installed')
def test_with_ffmpeg_it_is_mp4(cut_in: RunRecord, tmp_path: Path) -> None:
    """It is an ISO file by its first bytes."""
    written = write_video(FrameScene(_short(cut_in, 4)), tmp_path / 'run.mp4')
    assert written.read_bytes()[4:8] == b'ftyp'


def test_an_ffmpeg_that_fails_is_told_in_a_line(cut_in: RunRecord, tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    """One without the codec, for instance."""
    program = tmp_path / 'bin' / 'ffmpeg'
    program.parent.mkdir()
    program.write_text('#!/bin/sh\n[ "$1" = -version ] || { cat >/dev/null; exit 1; }\n')
    program.chmod(0o755)
    monkeypatch.setenv('PATH', f'{program.parent}:{os.environ["PATH"]}')
    with pytest.raises(InputError, match='ffmpeg could not write it'):
        write_video(FrameScene(_short(cut_in, 2)), tmp_path / 'run.mp4')
    assert [path.name for path in tmp_path.iterdir()] == ['bin']


@pytest.mark.parametrize('name', ['run.avi', 'missing/run.gif'])
def test_what_cannot_be_written_is_told_in_a_line(cut_in: RunRecord, tmp_path: Path,
                                                  name: str) -> None:
    """Another kind of file, a folder that is not there."""
    with pytest.raises(InputError) as raised:
        write_video(FrameScene(_short(cut_in, 2)), tmp_path / name)
    assert '\n' not in str(raised.value) and not list(tmp_path.iterdir())
