# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Streams of other programs: texts of any bytes, and a sender that begins anew."""

import json
import subprocess
import sys

import pytest

# liblsl reads its settings once in a process. Two senders without an id, one after the other.
RECEIVE = """
import json, time
from crgame_ros.game.instruments_spec import InletSpec, InstrumentsSpec
from crgame_ros.instruments.inlets import Inlets
from crgame_ros.instruments.outlets import configure
configure(InstrumentsSpec(True))
import pylsl
inlets = Inlets([InletSpec('marks')], (), 1, lambda text: None)

def until(done, *text):
    end_s = time.monotonic() + 20.0
    while not done() and time.monotonic() < end_s:
        inlets.look()
        if text and outlet.have_consumers():
            outlet.push_sample(text)
        batches.extend(inlets.poll())
        time.sleep(0.05)

for text in b'a', b'\\xff':
    batches = []
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo('marks', 'Markers', 1, 0, pylsl.cf_string, ''))
    until(lambda: batches, text)
    print(json.dumps([inlets.streams[0].gaps, batches[0].rows[0].connection, batches[0].texts[0]]))
    del outlet
    until(lambda: not inlets.open)
"""


def test_a_sender_that_comes_back_has_another_clock_and_may_send_any_bytes() -> None:
    """It counts as one gap, though liblsl still finds the lost stream for five seconds."""
    pytest.importorskip('pylsl', reason='the extra `instruments` is not installed')
    done = subprocess.run([sys.executable, '-c', RECEIVE], capture_output=True, text=True,
                          check=True)
    assert [json.loads(line) for line in done.stdout.splitlines()] == [
        [0, 0, ['a']], [1, 1, ['\ufffd']]]
