# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Documents, pictures and types that are made from the code agree with it."""

from importlib import import_module
from pathlib import Path
import sys

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'scripts'))

# Files of this group share the imports of the source tree.
pytestmark = pytest.mark.xdist_group('test_architecture')


@pytest.mark.slow
@pytest.mark.parametrize('script', [
    'architecture', 'make_gym_docs', 'make_interface_docs', 'make_key_tables', 'make_page_types',
    'make_table_docs'])
def test_what_is_made_from_the_code_is_up_to_date(script: str) -> None:
    for path, text in import_module(script).files().items():
        assert path.read_text(encoding='utf-8') == text, f'run scripts/{script}.py'
