# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verdicts as one HTML file, with the reports of failing runs, and how to see them again."""

from collections.abc import Sequence
from html import escape
from itertools import groupby
from pathlib import Path

from crgame_ros.analysis.report.command import REPORT_FILE
from crgame_ros.verdict.cases import CaseResult, replay_command
from crgame_ros.verdict.verdicts import Verdict
from crgame_ros.whole_file import write_text

_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:64em;margin:2em auto;padding:0 1em}
table{border-collapse:collapse;width:100%}td,th{padding:.25em .6em;text-align:left;
border-bottom:1px solid #8884;vertical-align:top}.bad{color:#c22;font-weight:600}
.good{color:#282}small,code{opacity:.75}code{font-size:.85em}h2{margin-top:1.6em}
@media(prefers-color-scheme:dark){body{background:#181a1d;color:#ddd}a{color:#8bf}
.bad{color:#f77}.good{color:#7c7}}"""


def write_page(verdicts: Sequence[Verdict], results: Sequence[CaseResult], out: Path) -> Path:
    """
    Write the page.

    :param out: its folder, with those of failing runs.
    :return: its file.
    :raises InputError: if it cannot be written.
    """
    bad = sum(not verdict.is_kept for verdict in verdicts)
    parts = [f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>Tests</title>'
             f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style>'
             f'<h1>{len(verdicts) - bad} expectations kept, {bad} broken</h1>'
             f'<p>{len(results)} runs. With several seeds, the share of good runs has its 95 % '
             'interval (Wilson). A command below a run shows its recording in the browser.</p>']
    for game, group in groupby(verdicts, lambda verdict: verdict.game):
        rows = ''.join(_row(verdict, out) for verdict in group)
        parts.append(f'<h2>{escape(game.stem)}</h2><table><tr><th>expected</th><th>verdict</th>'
                     f'<th>runs that broke it</th></tr>{rows}</table>')
    path = out / 'index.html'
    write_text('\n'.join(parts) + '</html>\n', path)
    return path


def _row(verdict: Verdict, out: Path) -> str:
    kind = 'good' if verdict.is_kept else 'bad'
    runs = []
    for result, lines in verdict.broken:
        copy = f', {result.case.copy[0]}' if result.case.copy else ''
        name = escape(f'seed {result.case.seed}{copy}')
        if result.folder is not None:
            link = (result.folder / REPORT_FILE).relative_to(out).as_posix()
            name = f'<a href="{escape(link)}">{name}</a>'
        told = f'<small>{escape("; ".join(lines))}</small>'
        if result.folder is not None:
            told += f'<br><code>{escape(replay_command(result.folder))}</code>'
        runs.append(f'{name} {told}')
    return (f'<tr><td>{escape(verdict.told)}</td><td class="{kind}">{escape(verdict.share())}</td>'
            f'<td>{"<br>".join(runs)}</td></tr>')
