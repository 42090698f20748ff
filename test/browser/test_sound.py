# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driver's sound, as samples rendered offline by a real browser, checked by FFT."""

from collections.abc import Iterator
import math
from typing import Any

from browser_support import Browser
from crgame_ros.paths import scenarios_directory
import numpy as np
import pytest
from sound_support import (
    FloatArray,
    other_vehicle,
    own_vehicle,
    RATE_Hz,
    render,
    render_voice,
    rms,
    strongest_Hz,
    update,
)
from world_support import RecordedRun, RunBackend, served

# Values of the car in docs/driving.md.
RATIOS = (4.171, 2.34, 1.521, 1.143, 0.867, 0.691)
FINAL_DRIVE, WHEEL_RADIUS_M, FIRINGS_A_TURN = 3.46, 0.31, 2
SOUND_SPEED = 343.0
# All transients have ended by then [samples].
SETTLED = RATE_Hz // 2
SILENT_MOTOR: dict[str, Any] = {'train': 'ELECTRIC', 'rpm': 0}


@pytest.fixture(scope='module')
def page(module_browser: Browser) -> Iterator[Browser]:
    """Open the page; its modules load under the policy that the server sends."""
    run = RecordedRun(scenarios_directory() / 'cut_in.yaml', 0.2)
    with served(RunBackend(run)) as server:
        module_browser.open(server.address)
        module_browser.wait('window.crgame?.ready && crgame.world.shown')
        yield module_browser
    assert module_browser.console_errors() == []


def heard_at(page: Browser, speed: float, powertrain: str = 'combustion',
             throttle: float = 0.3) -> dict[str, Any]:
    """Compute the update that the page's listener makes of a vehicle at a steady speed."""
    heard: dict[str, Any] = page.run_async("""
        const [speed, powertrain, throttle] = arguments;
        const { Listener } = await import('/static/js/sound/listener.js');
        const { VEHICLE_WIDTH } = await import('/static/js/frames.js');
        const [vehicle] = crgame.store.scene.vehicles;
        const row = new Float64Array(VEHICLE_WIDTH);
        row[3] = speed;
        row[8] = throttle;
        const heard = new Listener().hear(
          { vehicles: [{ ...vehicle, powertrain }], objects: [] },
          { t: 0, vehicles: row, objects: new Float64Array(0) }, vehicle.id);
        return { ...heard.own, train: heard.own.train.name.toUpperCase() };
        """, speed, powertrain, throttle)
    return heard


def band_rms(samples: FloatArray, low_Hz: float, high_Hz: float) -> float:
    """Return the amplitude between two frequencies."""
    spectrum = np.abs(np.fft.rfft(samples)) ** 2
    bins_Hz = np.fft.rfftfreq(len(samples), 1.0 / RATE_Hz)
    return math.sqrt(spectrum[(bins_Hz >= low_Hz) & (bins_Hz <= high_Hz)].sum())


@pytest.mark.matrix
@pytest.mark.parametrize('speed', [5.0, 13.9, 25.0, 36.0])
def test_the_engine_has_the_tone_of_its_speed_and_gear(page: Browser, speed: float) -> None:
    own = heard_at(page, speed)
    turns_a_s = speed / WHEEL_RADIUS_M / math.tau * RATIOS[own['gear']] * FINAL_DRIVE
    left, right = render(page, [update(own=own | {'speed': 0.0})])
    assert strongest_Hz(left[SETTLED:]) == pytest.approx(turns_a_s * FIRINGS_A_TURN, rel=5e-3)
    assert (left == right).all()


def test_a_car_that_stands_idles_and_a_motor_is_silent(page: Browser) -> None:
    left, _ = render(page, [update(own=heard_at(page, 0.0, throttle=0.0))])
    assert strongest_Hz(left[SETTLED:]) == pytest.approx(800 / 60 * FIRINGS_A_TURN, rel=5e-3)
    motor = heard_at(page, 0.0, 'electric')
    assert motor['rpm'] == 0
    assert not render(page, [update(own=motor)]).any()


def test_a_motor_sings_eight_times_a_turn(page: Browser) -> None:
    own = heard_at(page, 20.0, 'electric')
    left, _ = render(page, [update(own=own | {'speed': 0.0})])
    assert strongest_Hz(left[SETTLED:]) == pytest.approx(
        8 * 9.0 * 20.0 / WHEEL_RADIUS_M / math.tau, rel=5e-3)


@pytest.mark.exhaustive
@pytest.mark.parametrize(('powertrain', 'gear', 'gained_dB'), [
    # No pedal. 0.07 + 0.16 s from 20 to 44 % of the turns above idling; 1 + s from 51 to 89 %.
    ('combustion', 5, 2.84), ('electric', 0, 1.92)])
def test_the_engine_is_louder_the_faster_one_drives(
        page: Browser, powertrain: str, gear: int, gained_dB: float) -> None:
    """The amplitude of the engine's tones grows with speed within one gear."""
    heard = [heard_at(page, speed, powertrain, 0.0) for speed in (26.0, 32.0, 38.0, 45.0)]
    assert {own['gear'] for own in heard} == {gear}
    tones_Hz = [own['rpm'] / 60.0 * (FIRINGS_A_TURN if gear else 8) for own in heard]
    levels = []
    for own, tone_Hz in zip(heard, tones_Hz, strict=True):
        samples = render(page, [update(own=own | {'speed': 0.0})])[0][SETTLED:]
        assert strongest_Hz(samples) == pytest.approx(tone_Hz, rel=5e-3)
        levels.append(20.0 * math.log10(band_rms(samples, 0.9 * tone_Hz, 1.1 * tone_Hz)))
    assert levels == sorted(levels)
    assert levels[-1] - levels[0] == pytest.approx(gained_dB, abs=0.5)


def test_the_engine_is_louder_under_load_and_when_it_turns_faster(page: Browser) -> None:
    levels = [band_rms(render(page, [update(own=own_vehicle(rpm=rpm, load=load))])[0][SETTLED:],
                       20.0, 8000.0)
              for rpm, load in ((800, 0.0), (2500, 0.1), (2500, 0.9), (5500, 0.9))]
    assert levels == sorted(levels)
    assert levels[-1] > 3.0 * levels[0]


def test_tyres_and_wind_grow_with_speed(page: Browser) -> None:
    """Levels grow by 35 and 60 dB a decade: 10.5 and 18.1 dB from 15 to 30 m/s."""
    slow, fast = (render_voice(page, 'road_voice', 'RoadVoice', {
        'speed': speed, 'deceleration': 0.0, 'lateral': 0.0, 'offRoad': False}, 2)[SETTLED:]
        for speed in (15.0, 30.0))
    for (low_Hz, high_Hz), expected in (((80.0, 250.0), 35.0), ((2000.0, 6000.0), 60.0)):
        gained = 20.0 * math.log10(
            band_rms(fast, low_Hz, high_Hz) / band_rms(slow, low_Hz, high_Hz))
        assert gained == pytest.approx(expected * math.log10(2.0), abs=0.3)


@pytest.mark.parametrize(('state', 'tone_Hz'), [
    ({'deceleration': 9.0}, 2350.0), ({'lateral': 9.5}, 940.0)], ids=['brakes', 'tyres'])
def test_brakes_and_tyres_squeal(page: Browser, state: dict[str, float], tone_Hz: float) -> None:
    calm = {'speed': 12.0, 'deceleration': 0.0, 'lateral': 0.0, 'offRoad': False}
    quiet, loud = (render_voice(page, 'road_voice', 'RoadVoice', calm | more)[SETTLED:]
                   for more in ({}, state))
    near = (0.97 * tone_Hz, 1.03 * tone_Hz)
    assert band_rms(loud, *near) > 10.0 * band_rms(quiet, *near)


@pytest.mark.parametrize('closing', [30.0, -30.0])
def test_approaching_sounds_higher_and_receding_lower(page: Browser, closing: float) -> None:
    """The pitch changes by c / (c - v) for a standing listener."""
    arrival = page.run_async("""
        const { arrival } = await import('/static/js/sound/hearing.js');
        const still = { x: 0, y: 0, yaw: 0, vx: 0, vy: 0 };
        return arrival(still, { x: 6, y: 0, yaw: 0, vx: -arguments[0], vy: 0 });""", closing)
    silent = own_vehicle(**SILENT_MOTOR)
    # With slow tyres the spectrum shows the engine only.
    other = other_vehicle(rpm=3000, speed=0.0) | arrival
    left, _ = render(page, [update(own=silent, others=[other])])
    assert strongest_Hz(left[SETTLED:]) == pytest.approx(
        3000 / 30 * SOUND_SPEED / (SOUND_SPEED - closing), rel=3e-3)


@pytest.mark.parametrize(('x', 'louder'), [(-5.0, 0), (5.0, 1)], ids=['left', 'right'])
def test_a_vehicle_is_heard_from_its_side(page: Browser, x: float, louder: int) -> None:
    """Driving north, west is left; the other ear hears the vehicle too."""
    arrival = page.run_async("""
        const { arrival } = await import('/static/js/sound/hearing.js');
        const north = { x: 0, y: 0, yaw: Math.PI / 2, vx: 0, vy: 0 };
        return arrival(north, { x: arguments[0], y: 0, yaw: 0, vx: 0, vy: 0 });""", x)
    samples = render(page, [update(own=own_vehicle(**SILENT_MOTOR),
                                   others=[other_vehicle() | arrival])])[:, SETTLED:]
    assert 5.0 < rms(samples[louder]) / rms(samples[1 - louder]) < 20.0


def test_a_farther_vehicle_is_quieter(page: Browser) -> None:
    levels = [rms(render(page, [update(
        own=own_vehicle(**SILENT_MOTOR), others=[other_vehicle(distance=distance)])])[0][SETTLED:])
        for distance in (10.0, 20.0)]
    # 1 / distance, and slightly less, as it fades to 0 at 100 m.
    assert levels[1] / levels[0] == pytest.approx(0.5 * (1 - 0.2 ** 2) / (1 - 0.1 ** 2), rel=0.01)


@pytest.mark.parametrize('whose', ['own', 'other'])
def test_a_horn_has_two_notes_while_it_sounds(page: Browser, whose: str) -> None:
    def horn(on: bool) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        lights = 4 if on else 0
        return (own_vehicle(**SILENT_MOTOR, lights=lights if whose == 'own' else 0),
                [other_vehicle(**SILENT_MOTOR, lights=lights, speed=0.0)]
                if whose == 'other' else [])
    samples = render(page, [update(0.0, *horn(False)), update(0.5, *horn(True)),
                            update(1.5, *horn(False))], 2.5)[0]
    sounding = samples[int(0.75 * RATE_Hz):int(1.5 * RATE_Hz)]
    assert strongest_Hz(sounding, 400, 440) == pytest.approx(420, abs=1.0)
    assert strongest_Hz(sounding, 480, 520) == pytest.approx(500, abs=1.0)
    for silence in (samples[:int(0.5 * RATE_Hz)], samples[int(2.0 * RATE_Hz):]):
        assert rms(silence) < 0.2 * rms(sounding)


def test_an_indicator_clicks_three_times_a_second(page: Browser) -> None:
    """90 blinks a minute give a click when the lamp goes on and one when it goes off."""
    own = own_vehicle(**SILENT_MOTOR, lights=1)
    samples = render(page, [update(0.03 * i, own) for i in range(100)], 3.0)[0]
    loud = np.flatnonzero(np.abs(samples) > 0.005) / RATE_Hz
    starts = loud[np.insert(np.diff(loud) > 0.1, 0, True)]
    assert len(starts) == 9
    assert np.diff(starts) == pytest.approx(1 / 3, abs=0.04)


def test_a_collision_and_a_kerb_are_heard_once(page: Browser) -> None:
    # Slow enough not to hear the ground beside the road.
    own = own_vehicle(**SILENT_MOTOR, speed=0.5)
    peaks: list[float] = []
    for trouble, then in (({'collision': True},) * 2, ({'offRoad': True},) * 2,
                          # The wheels are on the road all the time.
                          ({'kerb': 1.0}, {}), ({'kerb': 0.35}, {})):
        samples = render(page, [update(0.0, own), update(0.5, own, **trouble),
                                update(0.53, own, **then), update(1.5, own, **then)], 2.5)[0]
        before, at, after = (np.abs(samples[int(begin * RATE_Hz):int(end * RATE_Hz)]).max()
                             for begin, end in ((0.3, 0.5), (0.5, 0.6), (1.6, 2.5)))
        assert at > 3.0 * max(before, after)
        peaks.append(at)
    assert peaks[1] == pytest.approx(peaks[2], rel=0.05) and peaks[3] < 0.5 * peaks[2]


def test_shut_it_is_silence_to_the_last_bit(page: Browser) -> None:
    """A closed graph, as while sound is off, gives zeros at standstill and at speed."""
    loud = own_vehicle(rpm=6000, load=1.0, speed=40.0, deceleration=10.0, lights=4)
    for own in (own_vehicle(), loud):
        assert not render(page, [update(own=own, others=[other_vehicle()])], gain=0.0).any()


def test_no_sample_is_ever_beyond_full_scale(page: Browser) -> None:
    """The case has all sounds at full volume: six neighbours, horns, brakes, a collision."""
    own = own_vehicle(rpm=6500, load=1.0, speed=60.0, deceleration=12.0, lateral=12.0, lights=7)
    others = [other_vehicle(id=f'av{i}', distance=0.5, rpm=6000, speed=50.0, lights=4, pan=0.3)
              for i in range(6)]
    samples = render(page, [update(0.0, own, others),
                            update(0.5, own, others, collision=True, offRoad=True)], 1.5)
    assert 0.3 < np.abs(samples).max() < 1.0
    # The limiter changes only loud sounds: an engine alone stays unchanged.
    single, double = (np.abs(render(page, [update(own=own_vehicle(rpm=3000))], gain=gain)).max()
                      for gain in (0.25, 0.5))
    assert double == pytest.approx(2.0 * single, rel=1e-3)


def test_nothing_clicks_when_gears_change_or_silence_comes(page: Browser) -> None:
    """No step between samples is larger than those of the loudest steady engine."""
    updates = [update(0.0, own_vehicle(rpm=5000, load=0.8)),
               update(0.5, own_vehicle(rpm=2800, load=0.1)),
               update(1.0, own_vehicle(rpm=2800, load=0.9))]
    moving = render(page, updates, 1.5)[0]
    steady = render(page, updates[:1])[0][SETTLED:]
    assert np.abs(np.diff(moving)).max() < 1.5 * np.abs(np.diff(steady)).max()
