# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Folders and archives of scenarios."""

import io
from pathlib import Path
import tarfile
import zipfile

from crgame_ros.paths import scenarios_directory

MERGE = (scenarios_directory() / 'ZAM_Merge-1_1_T-1.xml').read_bytes()
ID = b'ZAM_Merge-1_1_T-1'


def scenario(benchmark_id: str) -> bytes:
    """Return a scenario with this id in it."""
    assert MERGE.count(ID) == 1
    return MERGE.replace(ID, benchmark_id.encode())


def write(path: Path, benchmark_id: str | None = None) -> Path:
    """Write a scenario whose id is that of its file, or the one given."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(scenario(benchmark_id or path.stem))
    return path


def pack(path: Path, members: dict[str, bytes]) -> Path:
    """Write an archive; its kind is that of the name."""
    if path.suffix == '.zip':
        with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as zipped:
            for name, content in members.items():
                zipped.writestr(name, content)
        return path
    with tarfile.open(path, 'w' if path.suffix == '.tar' else 'w:gz') as packed:
        for name, content in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            packed.addfile(info, io.BytesIO(content))
    return path
