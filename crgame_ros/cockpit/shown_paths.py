# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
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
