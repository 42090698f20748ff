# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Texts for pages, without the folders of this machine."""

from pathlib import Path
import re

# In text and in JSON's escaped text. A path that begins like no folder here is a topic.
_NAME = r'(?:[^\s"\'<>,;:()\\]|\\u[0-9a-f]{4})*'
_FOLDERS = '|'.join(sorted(re.escape(path.name) for path in Path('/').iterdir() if path.is_dir()))
_PATH = re.compile(rf'(?<![\w./])/(?:{_FOLDERS})/{_NAME}' if _FOLDERS else r'(?!)')


def without_paths(text: str) -> str:
    """Return a text or JSON with absolute paths replaced by the names of their files."""
    return _PATH.sub(lambda found: found[0].rstrip('/').rpartition('/')[2], text)
