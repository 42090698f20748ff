# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The HTML document of a page: it contains its style and scripts, and permits no others."""

import base64
from collections.abc import Sequence
import hashlib
from pathlib import Path
import re

from crgame_ros.analysis.report.text import plain
from crgame_ros.page_libraries import plotly_script

PAGE = Path(__file__).resolve().parent / 'page'
# Plotly creates an empty `<style>`, and then adds rules to it by script.
_EMPTY = ''
# On loading, it also adds a style for maps, which reports do not have, unless it exists already.
_STYLE_OF_MAPS = re.compile(r'getElementById\("([0-9a-f]{64})"\)')


def plotted_document(title: str, body: str, data: str) -> str:
    """
    Return the document of a page with plots.

    :param title: text, shown in the browser's tab.
    :param body: HTML.
    :param data: data of the plots, JSON that is safe in a script.
    :raises CrgameError: if Plotly has not been fetched.
    """
    script = (PAGE / 'report.js').read_text(encoding='utf-8')
    plotly = plotly_script().read_text(encoding='utf-8')
    done = ''.join(f'<template id="{found}"></template>'
                   for found in dict.fromkeys(_STYLE_OF_MAPS.findall(plotly)))
    return _document(title, (page_style(), _EMPTY), done, '\n'.join((
        body, f'<script id="plots" type="application/json">{data}</script>',
        f'<script>{plotly}</script>', f'<script>{script}</script>')), (plotly, script))


def plain_document(title: str, body: str, style: str) -> str:
    """
    Return the document of a page without scripts.

    :param title: text, shown in the browser's tab.
    :param body: HTML.
    :param style: style rules in addition to those of all reports.
    """
    return _document(title, (f'{page_style()}\n{style}',), '', body, ())


def page_style() -> str:
    """Read the style of all reports."""
    return (PAGE / 'report.css').read_text(encoding='utf-8')


def _document(title: str, styles: Sequence[str], head: str, body: str,
              scripts: Sequence[str]) -> str:
    allowed = ' '.join(map(_hash, scripts)) or "'none'"
    policy = '; '.join((
        "default-src 'none'", f'script-src {allowed}',
        f'style-src {" ".join(map(_hash, styles))}', 'img-src data:', "base-uri 'none'",
        "form-action 'none'"))
    return '\n'.join((
        '<!DOCTYPE html>', '<html lang="en">', '<head>', '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="referrer" content="no-referrer">',
        f'<title>{plain(title)} – report</title>', '<link rel="icon" href="data:,">',
        f'<style>{styles[0]}</style>{head}', '</head>', '<body>', body, '</body>', '</html>', ''))


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
