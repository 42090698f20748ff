# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files of the drives are kept with the study and may not change during it."""

import os
from pathlib import Path
import shutil

from crgame_ros.errors import InputError
from crgame_ros.paths import scenarios_directory
from crgame_ros.study.desk.page_markdown import pictures_of
from crgame_ros.study.file import load_study
from crgame_ros.study.folder import StudyFolder
import pytest
import yaml


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Write a study together with all files that it may name."""
    base = tmp_path / 'mine'
    base.mkdir()
    for name in ('cut_in.yaml', 'cut_in.keys.yaml', 'ZAM_CutIn-1_1_T-1.xml'):
        shutil.copy(scenarios_directory() / name, base)
    (base / 'noisy.yaml').write_text('localisation: {position_noise: 0.5}\n')
    (base / 'hello.md').write_text('# Hello\n\n![a road](road.png) ![gone](none.png)\n')
    (base / 'road.png').write_bytes(b'a picture')
    (base / 'words.fr.yaml').write_text('ready: Je suis pret\n')
    study = base / 'study.yaml'
    study.write_text(yaml.safe_dump({
        'name': 'kept', 'settings': {'game': 'cut_in.yaml'}, 'before': [{'page': 'hello.md'}],
        'factors': [{'name': 'sight', 'levels': [
            {'name': 'clear'}, {'name': 'noisy', 'perception': 'noisy.yaml'}]}],
        'blocks': [{'name': 'main', 'practice': {}}]}))
    return study


def keep(file: Path, root: Path) -> None:
    """Create the files of a new session."""
    study = load_study(file)
    StudyFolder(root).keep_study(study, file, pictures_of(study))


def test_all_files_are_kept_to_the_byte(file: Path, tmp_path: Path) -> None:
    root = tmp_path / 'out'
    keep(file, root)
    kept = {path.relative_to(root / 'study').as_posix(): path.read_bytes()
            for path in (root / 'study').rglob('*') if path.is_file()}
    for name in ('study.yaml', 'hello.md', 'road.png', 'words.fr.yaml'):
        assert kept[name] == (file.parent / name).read_bytes()
    drives = yaml.safe_load(kept['drives.json'])
    assert list(drives) == ['main: practice', 'main: clear', 'main: noisy']
    # The files that a game names belong to it too.
    script = (file.parent / 'cut_in.keys.yaml').read_bytes()
    scenario = (file.parent / 'ZAM_CutIn-1_1_T-1.xml').read_bytes()
    contents = list(kept.values())
    assert scenario in contents
    assert drives['main: noisy']['avs'][0]['perception']['localisation']['position_noise'] == 0.5
    assert str(file.parent) not in kept['drives.json'].decode()
    # A person drives in the participant's seat instead of the script.
    assert script not in contents and drives['main: clear']['humans'][0]['driver'] == 'cockpit'
    before = {path: os.stat(path).st_mtime_ns for path in (root / 'study').rglob('*')}
    keep(file, root)
    assert {path: os.stat(path).st_mtime_ns for path in (root / 'study').rglob('*')
            if path.is_file()} == {path: at for path, at in before.items() if path.is_file()}


@pytest.mark.parametrize(('name', 'old', 'new', 'said'), [
    ('cut_in.yaml', 'speed: 26.0', 'speed: 27.0', 'humans: spawn: speed has changed'),
    ('ZAM_CutIn-1_1_T-1.xml', '<x>', '<x> ', 'scenario: scenario.xml has changed'),
    ('noisy.yaml', '0.5', '0.6', 'avs: perception: localisation: position_noise has changed'),
    ('road.png', 'a picture', 'another one', 'road.png: has changed'),
    ('words.fr.yaml', 'pret', 'prete', 'words.fr.yaml: has changed')])
def test_what_has_changed_is_named(file: Path, tmp_path: Path, name: str, old: str, new: str,
                                   said: str) -> None:
    root = tmp_path / 'out'
    keep(file, root)
    before = sorted((root / 'study').rglob('*'))
    path = file.parent / name
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError) as refusal:
        keep(file, root)
    assert said in str(refusal.value) and 'since the first participant' in str(refusal.value)
    assert sorted((root / 'study').rglob('*')) == before
