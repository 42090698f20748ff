# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files identified by their content."""

from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.evaluation.content import Content, ContentStore, digests_in, resolved
import pytest

MAP = Content('map.yaml', {'map.yaml': b'image: map.pgm\n', 'map.pgm': b'P5 1 1 255\n\0'})


def test_what_is_put_in_is_found_by_its_reference(tmp_path: Path) -> None:
    store = ContentStore(tmp_path / 'files')
    assert store.put(MAP) == store.put(MAP) == MAP.digest
    path = Path(resolved(MAP.reference, store.folder))
    assert path.name == 'map.yaml' and path.read_bytes() == MAP.files['map.yaml']
    assert (path.parent / 'map.pgm').read_bytes() == MAP.files['map.pgm']
    assert [item.name for item in store.folder.iterdir()] == [MAP.digest]


def test_a_digest_names_names_and_bytes() -> None:
    assert MAP.digest != Content('map.pgm', MAP.files).digest
    assert MAP.digest != Content('map.yaml', {**MAP.files, 'map.pgm': b'P5 1 1 255\n\1'}).digest


def test_all_references_of_a_text_are_found() -> None:
    other = Content('mine.py', {'mine.py': b''})
    text = f'{{"a":"{MAP.reference}","b":"keys:{other.reference}:Mine","c":"{MAP.reference}"}}'
    assert digests_in(text) == {MAP.digest, other.digest}
    assert resolved(f'{other.reference}:Mine', Path('/x')) == f'/x/{other.digest}/mine.py:Mine'


def test_a_content_travels(tmp_path: Path) -> None:
    here, there = ContentStore(tmp_path / 'here'), ContentStore(tmp_path / 'there')
    here.put(MAP)
    there.unpack(MAP.digest, here.packed(MAP.digest))
    assert (there.folder / MAP.digest / 'map.pgm').read_bytes() == MAP.files['map.pgm']


def test_another_content_under_its_name_is_refused(tmp_path: Path) -> None:
    here, there = ContentStore(tmp_path / 'here'), ContentStore(tmp_path / 'there')
    here.put(MAP)
    packed = here.packed(MAP.digest) | {'more': here.packed(MAP.digest)['map.yaml']}
    with pytest.raises(InputError, match='does not match its digest'):
        there.unpack(MAP.digest, packed)
    with pytest.raises(InputError, match='cannot be read'):
        here.packed('0' * 32)
