# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A hook of MkDocs: links from docs/ to files of the repository become the files' names.

The site has the pages of docs/ alone, and the repository has no public home to link to.
"""

import re
from typing import Any

# A link whose target begins above docs/; not an image.
OUTSIDE = re.compile(r'(?<!!)\[([^\]]+)\]\((?:\.\./)[^)\s]*\)')


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Keep the texts of such links."""
    return OUTSIDE.sub(r'\1', markdown)
