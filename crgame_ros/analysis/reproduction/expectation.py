# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an experiment must show, said before it is run, and what it did show."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

Evidence = TypeVar('Evidence')


class Finding(NamedTuple):
    """
    What was found of an expectation.

    :param is_met: whether it came out.
    :param text: the numbers that say so.
    """

    is_met: bool
    text: str


@dataclass(frozen=True)
class Expectation(Generic[Evidence]):
    """
    Something that must come out.

    :param name: in a few words.
    :param sentence: what must come out, with its bounds, and why these.
    :param paper: what the paper says of it.
    :param check: looks for it in the evidence.
    """

    name: str
    sentence: str
    paper: str
    check: Callable[[Evidence], Finding]


@dataclass(frozen=True)
class Judgement:
    """
    An expectation beside what was found.

    :param subject: the experiment, and who was looked at in it.
    """

    subject: str
    name: str
    sentence: str
    paper: str
    is_met: bool
    found: str

    @property
    def line(self) -> str:
        """Return it in one line."""
        return f'{"met" if self.is_met else "UNMET"}: {self.subject}: {self.name}: {self.found}'


def judge(subject: str, expectations: Sequence[Expectation[Evidence]],
          evidence: Evidence) -> tuple[Judgement, ...]:
    """Look for every expectation in the evidence."""
    judgements = []
    for each in expectations:
        finding = each.check(evidence)
        # Comparisons of arrays give a bool of their own, which JSON does not know.
        judgements.append(Judgement(subject, each.name, each.sentence, each.paper,
                                    bool(finding.is_met), finding.text))
    return tuple(judgements)
