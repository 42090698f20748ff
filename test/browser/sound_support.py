# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Samples that the page's sound graph renders in an offline context of a real browser."""

import base64
from collections.abc import Sequence
from typing import Any

from browser_support import Browser
import numpy as np
from numpy.typing import NDArray

RATE_Hz = 44100
FloatArray = NDArray[np.float64]

# The graph as a page builds it, in a context of two channels. Each update of the heard sounds
# happens when the rendering reaches its time, as it does live.
_RENDER = """
const [seconds, gain, updates] = arguments;
const { SoundGraph } = await import('/static/js/sound/sound_graph.js');
const trains = await import('/static/js/sound/drive_train.js');
const context = new OfflineAudioContext(2, Math.round(seconds * 44100), 44100);
const graph = new SoundGraph(context);
const make = (vehicle) => ({ ...vehicle, train: trains[vehicle.train] });
const apply = ({ at, own, others, trouble, t }, when) => graph.update(
  { t: t ?? at, own: make(own), others: others.map(make) }, trouble, when);
if (gain > 0) { graph.open(gain, 0); }
for (const update of updates) {
  if (update.at > 0) {
    context.suspend(update.at).then(() => {
      apply(update, context.currentTime);
      context.resume();
    });
  } else {
    apply(update, 0);
  }
}
const buffer = await context.startRendering();
"""
# Base64 of all channels in sequence, as an array of numbers would take seconds.
_RETURN = """
const samples = new Float32Array(buffer.numberOfChannels * buffer.length);
for (let i = 0; i < buffer.numberOfChannels; i += 1) {
  samples.set(buffer.getChannelData(i), i * buffer.length);
}
const bytes = new Uint8Array(samples.buffer);
let text = '';
for (let i = 0; i < bytes.length; i += 32768) {
  text += String.fromCharCode(...bytes.subarray(i, i + 32768));
}
return [buffer.numberOfChannels, btoa(text)];
"""

NO_TROUBLE = {'collision': False, 'offRoad': False, 'kerb': 0}


def own_vehicle(**values: Any) -> dict[str, Any]:
    """Return a standing car with a silent engine, with given changes."""
    return {'id': 'hv0', 'train': 'CAR', 'gear': 0, 'rpm': 800, 'load': 0.0, 'speed': 0.0,
            'deceleration': 0.0, 'lateral': 0.0, 'lights': 0} | values


def other_vehicle(**values: Any) -> dict[str, Any]:
    """Return a car that passes ahead, with given changes."""
    return {'id': 'av0', 'train': 'CAR', 'rpm': 1500, 'speed': 15.0, 'lights': 0,
            'distance': 4.0, 'pan': 0.0, 'doppler': 1.0} | values


def update(at: float = 0.0, own: dict[str, Any] | None = None,
           others: Sequence[dict[str, Any]] = (), **trouble: float) -> dict[str, Any]:
    """Return an update of the heard sounds at a time [s]."""
    return {'at': at, 'own': own or own_vehicle(), 'others': list(others),
            'trouble': NO_TROUBLE | trouble}


def decoded(answer: Any) -> FloatArray:
    """Decode the samples (channels, n) that a script has returned."""
    channels, text = answer
    samples = np.frombuffer(base64.b64decode(text), dtype='<f4').astype(np.float64)
    return samples.reshape(channels, -1)


def render(browser: Browser, updates: Sequence[dict[str, Any]], seconds: float = 1.0,
           gain: float = 1.0) -> FloatArray:
    """
    Render the output of the whole graph.

    :param updates: heard sounds, in order of time.
    :param gain: of the volume; 0 keeps the graph closed, as while sound is off.
    :return: (2, n) samples, left and right.
    """
    return decoded(browser.run_async(_RENDER + _RETURN, seconds, gain, list(updates)))


def render_voice(browser: Browser, module: str, name: str, state: dict[str, Any],
                 seconds: float = 1.0) -> FloatArray:
    """
    Render one voice alone, without limiter and volume.

    :return: (n,) samples.
    """
    return decoded(browser.run_async("""
        const [module, name, state, seconds] = arguments;
        const voices = await import('/static/js/sound/voices.js');
        const trains = await import('/static/js/sound/drive_train.js');
        const Voice = (await import(`/static/js/sound/${module}.js`))[name];
        const context = new OfflineAudioContext(1, seconds * 44100, 44100);
        const voice = new Voice(context, voices.makeNoise(context));
        voice.output.connect(context.destination);
        voice.update({ ...state, train: trains[state.train] }, 0);
        const buffer = await context.startRendering();
        """ + _RETURN, module, name, state, seconds))[0]


def strongest_Hz(samples: FloatArray, low: float = 20.0, high: float = 8000.0) -> float:
    """Return the strongest tone between two frequencies, interpolated between FFT bins [Hz]."""
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    bins_Hz = np.fft.rfftfreq(len(samples), 1.0 / RATE_Hz)
    allowed = np.flatnonzero((bins_Hz >= low) & (bins_Hz <= high))
    peak = int(allowed[np.argmax(spectrum[allowed])])
    below, at, above = np.log(spectrum[peak - 1:peak + 2])
    shift = 0.5 * (below - above) / (below - 2.0 * at + above)
    return float((peak + shift) * RATE_Hz / len(samples))


def rms(samples: FloatArray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(samples ** 2)))
