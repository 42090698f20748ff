# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solutions of many runs: which go into the archive, and why the others do not."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import gc
import io
from pathlib import Path
import zipfile

from crgame_ros.errors import CrgameError, InputError, one_line
from crgame_ros.paths import make_folder
from crgame_ros.submission.drives import Drive
from crgame_ros.submission.solution_of_run import BenchmarkChoice, judged_run, JudgedSolution
from crgame_ros.whole_file import write_bytes

# Of the members of an archive: its bytes depend on the solutions alone.
_EARLIEST = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Candidate:
    """
    The solution of a run, or the reason why there is none.

    :param name: of the run, for people.
    :param scenario: id of the scenario, or its file's name where it could not be read.
    :param solution: None where there is none.
    :param fault: why it does not go in, one line; empty if it does.
    :param remarks: notes, one line each.
    """

    name: str
    scenario: str
    solution: JudgedSolution | None
    fault: str
    remarks: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary."""
        found = self.solution
        return {
            'run': self.name, 'scenario': self.scenario, 'submitted': not self.fault,
            'benchmark_id': None if found is None else found.benchmark_id,
            'valid': found is not None and found.is_valid,
            'states': None if found is None else found.states,
            'cost': None if found is None else found.cost,
            'faults': [self.fault] if found is None else list(found.faults),
            'reason': self.fault, 'remarks': list(self.remarks)}


def judge_drives(drives: Sequence[Drive], choice: BenchmarkChoice,
                 say: Callable[[str, float], object] = lambda _what, _share: None
                 ) -> list[Candidate]:
    """
    Read or drive runs, and judge their solutions.

    Of several valid solutions of one benchmark, the one of the lowest cost is submitted.

    :param say: called with what is done next, and the share done so far.
    :raises InputError: if model and cost function do not go together.
    """
    choice.check()
    judged = []
    for number, drive in enumerate(drives):
        say(f'{drive.scenario}, {drive.name}', number / len(drives))
        judged.append(_judged(drive, choice))
        # What is left of the checker's scenarios would make it warn at the end.
        gc.collect()
    best: dict[str, JudgedSolution] = {}
    for found in (each.solution for each in judged):
        if found is not None and found.is_valid:
            rival = best.setdefault(found.benchmark_id, found)
            if _cost(found) < _cost(rival):
                best[found.benchmark_id] = found
    return [_compared(each, best) for each in judged]


def _judged(drive: Drive, choice: BenchmarkChoice) -> Candidate:
    try:
        run = drive.make()
        found = judged_run(run.log, choice, run.when)
    except CrgameError as error:
        return Candidate(drive.name, drive.scenario, None, one_line(str(error)))
    return Candidate(drive.name, found.scenario_id, found, next(iter(found.faults), ''),
                     (*found.remarks, *run.remarks))


def _compared(found: Candidate, best: dict[str, JudgedSolution]) -> Candidate:
    solution = found.solution
    if solution is None or not solution.is_valid or best[solution.benchmark_id] is solution:
        return found
    return replace(found, fault='valid, but another run solves it at no more cost')


def _cost(found: JudgedSolution) -> float:
    assert found.cost is not None
    return found.cost


def write_archive(candidates: Sequence[Candidate], path: Path) -> int:
    """
    Write the solutions that are submitted into an archive.

    :return: their number.
    :raises InputError: if the file cannot be written.
    """
    stream = io.BytesIO()
    chosen = [each.solution for each in candidates if each.solution is not None and not each.fault]
    with zipfile.ZipFile(stream, 'w', zipfile.ZIP_DEFLATED) as archive:
        for found in sorted(chosen, key=lambda each: each.benchmark_id):
            member = zipfile.ZipInfo(f'solution_{found.benchmark_id}.xml', _EARLIEST)
            member.compress_type = zipfile.ZIP_DEFLATED
            member.external_attr = 0o644 << 16
            archive.writestr(member, found.xml_text)
    write_bytes(stream.getvalue(), path)
    return len(chosen)


def check_archive(path: Path) -> None:
    """
    Check where an archive goes, before the work.

    :raises InputError: if it is no .zip, is there already, or its folder cannot be made.
    """
    if path.suffix.lower() != '.zip':
        raise InputError('is no name of an archive', str(path), 'give one that ends in .zip')
    if path.exists():
        raise InputError('is there already', str(path), 'remove it, or name another with --out')
    make_folder(path.parent, 'name another with --out')
