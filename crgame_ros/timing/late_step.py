# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The causes of a late step: its lateness, split by the thread's measured times."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

# A step is late if its error e_n is greater [s]; the 99th percentile should not exceed it.
LATE_S = 0.5e-3


class Phase(IntEnum):
    """The phases of the loop from the start of one cycle to that of the next."""

    INPUTS = 1
    STEP = 2
    PUBLISH = 3
    SERVICES = 4
    WAIT = 5


# Names of the phases in a sentence, after "while".
PHASE_WORDS = {Phase.INPUTS: 'taking inputs', Phase.STEP: 'stepping',
               Phase.PUBLISH: 'publishing', Phase.SERVICES: 'serving orders',
               Phase.WAIT: 'waiting for its time'}


class Causes(NamedTuple):
    """
    Time by cause, in one unit throughout; `docs/timing.md` defines each of them.

    :param processor: ready but not running: other processes had the processor.
    :param host: the machine did not run: its host stole the time, or its timer woke it late.
    :param stopped: by a signal (SIGSTOP).
    :param page_faults: memory that had to be loaded or allocated.
    :param gc: Python's garbage collection.
    :param services: orders and parameters that the loop served.
    :param blocked: asleep within a call that should not have slept, such as for a lock.
    :param work: the loop's own computation.
    """

    processor: float = 0.0
    host: float = 0.0
    stopped: float = 0.0
    page_faults: float = 0.0
    gc: float = 0.0
    services: float = 0.0
    blocked: float = 0.0
    work: float = 0.0


NO_CAUSES = Causes()
# Time without a known cause.
UNEXPLAINED = 'unexplained'
CAUSE_WORDS = {'processor': 'waiting for the processor', 'host': 'the host did not run it',
               'stopped': 'stopped by a signal', 'page_faults': 'page faults',
               'gc': 'garbage collection', 'services': 'services',
               'blocked': 'blocked in a call', 'work': 'own work', UNEXPLAINED: UNEXPLAINED}
# Causes outside this program.
FROM_OUTSIDE = ('processor', 'host', 'stopped')
# A step has time for its work. The time that fits is subtracted from the causes in this order, the
# likeliest first.
_FITS_FIRST = ('work', 'services', 'page_faults', 'gc', 'blocked', 'processor', 'host', 'stopped')


class PhaseUse(NamedTuple):
    """
    The measured times and faults of a thread in one phase.

    :param lasted_ns: wall time; of a wait, the time by which it exceeded its due end [ns]
    :param computed_ns: processor time [ns]
    :param waited_ns: ready, but without a processor; None where the kernel does not count it [ns]
    :param collected_ns: in garbage collections [ns]
    :param minor_faults: page faults served from memory.
    :param major_faults: page faults that waited for a disk.
    """

    phase: Phase
    lasted_ns: float
    computed_ns: float
    waited_ns: float | None
    collected_ns: float = 0.0
    minor_faults: int = 0
    major_faults: int = 0


class StepConditions(NamedTuple):
    """
    Further conditions of a step.

    :param stolen_ns: the least time that the host took from a processor meanwhile [ns]
    :param stopped: whether the process was continued by a signal.
    :param fault_ns: duration of a minor page fault on this machine [ns]
    """

    stolen_ns: float = 0.0
    stopped: bool = False
    fault_ns: float = 0.0


def causes_of(uses: Sequence[PhaseUse], late_ns: float, around: StepConditions) -> Causes:
    """
    Split the lateness of a step by cause.

    The time that a step has for its work is left out. So the causes add up to the lateness, or to
    less: the rest is unexplained.

    :param uses: the phases since the step before.
    :param late_ns: the time by which they exceed a step [ns]
    """
    spent = dict.fromkeys(Causes._fields, 0.0)
    for use in uses:
        found = _waiting(use, around) if use.phase is Phase.WAIT else _working(use, around)
        for cause, time_ns in found.items():
            spent[cause] += time_ns
    stolen_ns = around.stolen_ns
    # Neither the kernel's queue nor its processor times show that a processor stood still.
    for cause in ('processor', 'work', 'services'):
        moved = min(stolen_ns, spent[cause])
        spent[cause] -= moved
        spent['host'] += moved
        stolen_ns -= moved
    fits = max(0.0, sum(spent.values()) - late_ns)
    for cause in _FITS_FIRST:
        moved = min(fits, spent[cause])
        spent[cause] -= moved
        fits -= moved
    return Causes(**spent)


def _waiting(use: PhaseUse, around: StepConditions) -> dict[str, float]:
    """Split the time by which a thread was woken late."""
    if use.waited_ns is None:
        return {'stopped': use.lasted_ns} if around.stopped else {}
    waited = min(use.lasted_ns, use.waited_ns)
    return {'processor': waited, 'stopped' if around.stopped else 'host': use.lasted_ns - waited}


def _working(use: PhaseUse, around: StepConditions) -> dict[str, float]:
    """Split the time of a phase that should compute throughout."""
    collected = min(use.collected_ns, use.computed_ns)
    faults = min(use.minor_faults * around.fault_ns, use.computed_ns - collected)
    found = {'gc': collected, 'page_faults': faults}
    own = 'services' if use.phase is Phase.SERVICES else 'work'
    found[own] = use.computed_ns - collected - faults
    if use.waited_ns is None:
        return found
    found['processor'] = use.waited_ns
    asleep_ns = max(0.0, use.lasted_ns - use.computed_ns - use.waited_ns)
    if use.major_faults:
        asleep = 'page_faults'
    elif around.stopped:
        asleep = 'stopped'
    else:
        asleep = 'services' if own == 'services' else 'blocked'
    found[asleep] = found.get(asleep, 0.0) + asleep_ns
    return found


def longest_phase(uses: Sequence[PhaseUse]) -> Phase:
    """Return the phase in which most time was lost."""
    return max(uses, key=lambda use: use.lasted_ns).phase
