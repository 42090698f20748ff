# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why a step was late: its lateness split by cause, from what its thread went through."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

# A step is late if its error e_n is greater [s]: what its 99th percentile should not exceed.
LATE_S = 0.5e-3


class Phase(IntEnum):
    """What the loop does from the start of one cycle to that of the next."""

    INPUTS = 1
    STEP = 2
    PUBLISH = 3
    SERVICES = 4
    WAIT = 5


# What a phase is called in a sentence that begins with "while".
PHASE_WORDS = {Phase.INPUTS: 'taking inputs', Phase.STEP: 'stepping',
               Phase.PUBLISH: 'publishing', Phase.SERVICES: 'serving orders',
               Phase.WAIT: 'waiting for its time'}


class Causes(NamedTuple):
    """
    Time by cause, in one unit throughout; `docs/timing.md` defines each of them.

    :param processor: ready, and not run: others had the processor.
    :param host: the machine did not run: stolen by its host, or woken late by its timer.
    :param stopped: by a signal (SIGSTOP).
    :param page_faults: memory that had to be fetched or made.
    :param gc: Python's garbage collection.
    :param services: orders and parameters that the loop served.
    :param blocked: asleep within a call that should not have slept, such as for a lock.
    :param work: our own computing.
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
# What nothing else accounts for.
UNEXPLAINED = 'unexplained'
CAUSE_WORDS = {'processor': 'waiting for the processor', 'host': 'the host did not run it',
               'stopped': 'stopped by a signal', 'page_faults': 'page faults',
               'gc': 'garbage collection', 'services': 'services',
               'blocked': 'blocked in a call', 'work': 'own work', UNEXPLAINED: UNEXPLAINED}
# What comes from outside this program; the rest is ours.
FROM_OUTSIDE = ('processor', 'host', 'stopped')
# A step has time for its work. What fits into it is taken off the likeliest part of it first.
_FITS_FIRST = ('work', 'services', 'page_faults', 'gc', 'blocked', 'processor', 'host', 'stopped')


class PhaseUse(NamedTuple):
    """
    What a thread went through in one phase.

    :param phase: which.
    :param lasted_ns: on the wall clock; of a wait for what it went on after its end was due [ns]
    :param computed_ns: processor time [ns]
    :param waited_ns: ready, but without a processor; None where the kernel does not tell [ns]
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
    What is known of a step's time besides.

    :param stolen_ns: what the host certainly took of a processor meanwhile [ns]
    :param stopped: whether a signal let the process go on.
    :param fault_ns: what a minor page fault takes on this machine [ns]
    """

    stolen_ns: float = 0.0
    stopped: bool = False
    fault_ns: float = 0.0


def causes_of(uses: Sequence[PhaseUse], late_ns: float, around: StepConditions) -> Causes:
    """
    Split the lateness of a step by cause.

    What the step had time for is left out, so that all causes together give the lateness, or less:
    the rest has no explanation.

    :param uses: the phases since the step before.
    :param late_ns: by how much longer they took than a step [ns]
    """
    spent = dict.fromkeys(Causes._fields, 0.0)
    for use in uses:
        found = _waiting(use, around) if use.phase is Phase.WAIT else _working(use, around)
        for cause, time_ns in found.items():
            spent[cause] += time_ns
    stolen_ns = around.stolen_ns
    # Neither the kernel's queue nor its processor times tell that a processor stood still.
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
    """Split what a thread overslept: it had asked to be woken before."""
    if use.waited_ns is None:
        return {'stopped': use.lasted_ns} if around.stopped else {}
    waited = min(use.lasted_ns, use.waited_ns)
    return {'processor': waited, 'stopped' if around.stopped else 'host': use.lasted_ns - waited}


def _working(use: PhaseUse, around: StepConditions) -> dict[str, float]:
    """Split a phase that should compute throughout."""
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
