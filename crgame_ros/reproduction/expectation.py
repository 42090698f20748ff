# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Expectations of an experiment, stated before it runs, and their comparison to its results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

Evidence = TypeVar('Evidence')


class Finding(NamedTuple):
    """
    The result for an expectation.

    :param is_met: whether the expectation is met.
    :param text: the numbers that show it.
    """

    is_met: bool
    text: str


@dataclass(frozen=True)
class Expectation(Generic[Evidence]):
    """
    A result that an experiment must show.

    :param name: a few words.
    :param sentence: the required result with its bounds, and the reason for these.
    :param paper: what the paper states on it.
    :param check: function that checks it in the evidence.
    """

    name: str
    sentence: str
    paper: str
    check: Callable[[Evidence], Finding]


@dataclass(frozen=True)
class Judgement:
    """
    An expectation with its finding.

    :param subject: the experiment, and the vehicle or run examined in it.
    """

    subject: str
    name: str
    sentence: str
    paper: str
    is_met: bool
    found: str

    @property
    def line(self) -> str:
        """Return the judgement in one line."""
        return f'{"met" if self.is_met else "UNMET"}: {self.subject}: {self.name}: {self.found}'


def judge(subject: str, expectations: Sequence[Expectation[Evidence]],
          evidence: Evidence) -> tuple[Judgement, ...]:
    """Check every expectation in the evidence."""
    judgements = []
    for each in expectations:
        finding = each.check(evidence)
        # Comparisons of arrays result in numpy's bool, which JSON cannot write.
        judgements.append(Judgement(subject, each.name, each.sentence, each.paper,
                                    bool(finding.is_met), finding.text))
    return tuple(judgements)
