# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame evaluate --summary`: print and write the summary of an evaluation."""

import argparse
import json
from pathlib import Path
import sys

SUMMARY_FILE = 'summary.html'
FORMATS = ('text', 'markdown', 'json')


def add_summary_arguments(parser: 'argparse.ArgumentParser | argparse._ArgumentGroup') -> None:
    """Declare the arguments of a summary."""
    parser.add_argument('--format', choices=FORMATS, default='text',
                        help='output format (default: text)')
    parser.add_argument('--measure', action='append', metavar='NAME', help='measure to summarise; '
                        'may be given several times (default: all that docs/evaluation.md names)')
    parser.add_argument('--by', action='append', metavar='FACTOR', help='factor that defines '
                        'the groups: planner, scenario, game, human, participant, perception or '
                        'traffic; may be given several times (default: planner)')
    parser.add_argument('--baseline', metavar='PLANNER', help='planner with which the others '
                        'are compared (default: idm, or the first planner)')
    parser.add_argument('--worst', action='append', metavar='NAME', help='measure by which the '
                        'worst cells are chosen; may be given several times, the first one counts '
                        'first (default: collision, then worst_ttc)')


def summarise_command(folder: Path, values: argparse.Namespace) -> int:
    """
    Print the summary of an evaluation, and write its page into the folder.

    :param folder: folder of the evaluation.
    :param values: values of the arguments that `add_summary_arguments` declares.
    :raises InputError: if the evaluation or an argument cannot be used.
    """
    from crgame_ros.evaluation.summary.html_page import write_summary_page
    from crgame_ros.evaluation.summary.markdown import summary_markdown
    from crgame_ros.evaluation.summary.summarise import summarise
    from crgame_ros.evaluation.summary.text import summary_text
    summary = summarise(folder, measures=values.measure, by=tuple(values.by or ('planner',)),
                        baseline=values.baseline, worst=values.worst)
    if values.format == 'json':
        print(json.dumps(summary.as_dict(), indent=2, allow_nan=False, ensure_ascii=False))
    else:
        write = summary_markdown if values.format == 'markdown' else summary_text
        print(write(summary), end='')
    page = folder / SUMMARY_FILE
    write_summary_page(summary, page)
    print(page, file=sys.stderr)
    return 0
