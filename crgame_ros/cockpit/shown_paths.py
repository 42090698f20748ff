# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Texts for pages: where a file lies on this machine is nobody's business, its name is."""

from pathlib import Path
import re

# In text and in JSON's escaped text; what begins like no folder of this machine is a topic.
_NAME = r'(?:[^\s"\'<>,;:()\\]|\\u[0-9a-f]{4})*'
_FOLDERS = '|'.join(sorted(re.escape(path.name) for path in Path('/').iterdir() if path.is_dir()))
_PATH = re.compile(rf'(?<![\w./])/(?:{_FOLDERS})/{_NAME}' if _FOLDERS else r'(?!)')


def without_paths(text: str) -> str:
    """
    Replace absolute paths by the names of their files.

    :param text: for people, or JSON.
    """
    return _PATH.sub(lambda found: found[0].rstrip('/').rpartition('/')[2], text)
