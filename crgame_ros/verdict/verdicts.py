# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verdict on each expectation of a game, over all its runs, and the page of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree

from crgame_ros.analysis.report.command import REPORT_FILE
from crgame_ros.analysis.report.document import Article, Page
from crgame_ros.analysis.report.section import free, marked, plain, Section, table
from crgame_ros.verdict.cases import CaseResult, replay_command
from crgame_ros.whole_file import write_text
from scipy.stats import binomtest

_LEVEL = 0.95


@dataclass(frozen=True)
class Verdict:
    """
    The verdict on one expectation, or on a game that could not be run.

    :param game: file of the game.
    :param told: the expectation in words; of a game that could not be run, that.
    :param good: number of runs that kept it.
    :param runs: number of runs.
    :param needed: share of the runs that has to keep it.
    :param broken: runs that did not, each with how, a line for each vehicle.
    :param wall_s: time that the runs took together.
    """

    game: Path
    told: str
    good: int
    runs: int
    needed: float
    broken: tuple[tuple[CaseResult, tuple[str, ...]], ...]
    wall_s: float

    @property
    def is_kept(self) -> bool:
        """Return whether enough runs kept it."""
        # 0.55 * 100 is a little more than 55.
        return self.good >= self.needed * self.runs - 1e-9

    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval by Wilson of the share of runs that keep it."""
        found = binomtest(self.good, self.runs).proportion_ci(_LEVEL, 'wilson')
        return float(found.low), float(found.high)

    def share(self) -> str:
        """Return the share of good runs, with its interval if there are several."""
        if self.runs == 1:
            return 'kept' if self.good else 'broken'
        low, high = self.interval()
        return (f'{self.good} of {self.runs} runs, {100 * self.good / self.runs:.0f} % '
                f'({100 * low:.0f} to {100 * high:.0f} %)')


def verdicts_of(results: Sequence[CaseResult]) -> Iterator[Verdict]:
    """Yield the verdicts of each game, in order: first on whether it runs, if it does not."""
    for game, group in groupby(results, lambda result: result.case.game):
        every = list(group)
        runs = [result for result in every if result.case.copy is None]
        wall_s = sum(result.wall_s for result in runs)
        failed = [result for result in runs if result.error]
        if failed:
            yield Verdict(game, 'it runs', len(runs) - len(failed), len(runs), 1.0,
                          tuple((result, (result.error,)) for result in failed), wall_s)
        ran = [result for result in runs if not result.error]
        for place, expected in enumerate(ran[0].expectations if ran else ()):
            broken = tuple((result, result.broken[place]) for result in ran
                           if result.broken[place])
            yield Verdict(game, expected.told(), len(ran) - len(broken), len(ran),
                          expected.share, broken, wall_s)
        copies = [result for result in every if result.case.copy is not None]
        if copies:
            yield _on_copies(game, {result.case.seed: result for result in runs}, copies)


def _on_copies(game: Path, originals: Mapping[int, CaseResult],
               copies: Sequence[CaseResult]) -> Verdict:
    """Return the verdict on copies, which have to keep and break what their originals do."""
    found = [(copy, tuple(_differences(originals[copy.case.seed], copy))) for copy in copies]
    different = tuple((copy, lines) for copy, lines in found if lines)
    names = ', '.join(dict.fromkeys(copy.case.copy[0] for copy in copies if copy.case.copy))
    return Verdict(game, f'copies keep and break the same ({names})',
                   len(copies) - len(different), len(copies), 1.0, different,
                   sum(copy.wall_s for copy in copies))


def _differences(original: CaseResult, copy: CaseResult) -> Iterator[str]:
    if original.error or copy.error:
        if copy.error and not original.error:
            yield copy.error
        return
    for expected, there, here in zip(original.expectations, original.broken, copy.broken,
                                     strict=True):
        if bool(there) != bool(here):
            yield (f'{expected.told()}: kept, but {"; ".join(there)} in the game as it is'
                   if there else f'{"; ".join(here)}, but kept in the game as it is')


def junit_xml(verdicts: Sequence[Verdict]) -> bytes:
    """Return verdicts as JUnit XML, as CI servers read it: a case for each expectation."""
    bad = sum(not verdict.is_kept for verdict in verdicts)
    root = ElementTree.Element('testsuites')
    suite = ElementTree.SubElement(root, 'testsuite', {
        'name': 'crgame test', 'tests': str(len(verdicts)), 'failures': str(bad), 'errors': '0'})
    counted: set[Path] = set()
    for verdict in verdicts:
        # The time of the runs is that of all expectations together.
        wall_s = 0.0 if verdict.game in counted else verdict.wall_s
        counted.add(verdict.game)
        case = ElementTree.SubElement(suite, 'testcase', {
            'classname': str(verdict.game), 'name': verdict.told, 'time': f'{wall_s:.3f}'})
        lines = broken_lines(verdict)
        if not verdict.is_kept:
            failure = ElementTree.SubElement(case, 'failure', {'message': verdict.share()})
            failure.text = '\n'.join(lines)
        elif lines:
            ElementTree.SubElement(case, 'system-out').text = '\n'.join(lines)
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding='utf-8', xml_declaration=True))


def _of_copy(result: CaseResult) -> str:
    return f', {result.case.copy[0]}' if result.case.copy else ''


def broken_lines(verdict: Verdict) -> list[str]:
    """Return a line for each vehicle and run that broke an expectation."""
    return [f'seed {result.case.seed}{_of_copy(result)}: {line}'
            for result, lines in verdict.broken for line in lines]


def write_page(verdicts: Sequence[Verdict], results: Sequence[CaseResult], out: Path) -> Path:
    """
    Write the page.

    :param out: its folder, with those of failing runs.
    :return: its file.
    :raises InputError: if it cannot be written.
    """
    bad = sum(not verdict.is_kept for verdict in verdicts)
    sections = [
        Section(f'game-{place}', free(game.stem), table(
            'Expectations, and the runs that broke them', ('expected', 'verdict', 'broken by'),
            (_cells(verdict, out) for verdict in group)))
        for place, (game, group) in enumerate(groupby(verdicts, lambda verdict: verdict.game))]
    path = out / 'index.html'
    write_text(Page(
        f'{len(verdicts) - bad} expectations kept, {bad} broken',
        f'{len(results)} runs. With several seeds, the share of good runs has its 95 % interval '
        '(Wilson). A command below a run shows its recording in the browser.', (),
        [Article(sections)]).html(), path)
    return path


def _cells(verdict: Verdict, out: Path) -> tuple[str, str, str]:
    runs = []
    for result, lines in verdict.broken:
        name = f'seed {result.case.seed}{_of_copy(result)}'
        told = plain('; '.join(lines))
        if result.folder is not None:
            link = (result.folder / REPORT_FILE).relative_to(out).as_posix()
            name = f'<a href="{plain(link)}">{name}</a>'
            told += f'<br><code>{plain(replay_command(result.folder))}</code>'
        runs.append(f'{name}: {told}')
    return plain(verdict.told), marked(verdict.share(), not verdict.is_kept), '<br>'.join(runs)
