// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Gamepads and wheels of the Gamepad API: the active device and its inputs. */

import { LIGHT_BUTTONS } from '../lights.js';
import {
  gearAfter, loadProfile, pedalValue, sampleOf, saveProfile, steeringValue,
} from './gamepad_profile.js';

import type { Profile } from './gamepad_profile.js';

// A larger change of any axis or button is intended and not sensor noise.
const MEANT = 0.2;
// A pedal counts only after it was seen at rest: for axes that have not moved since the device
// was plugged in, browsers report 0, which is half of a wheel's pedal travel.
const AT_REST = 0.1;
const STEPS = 1000;
const PEDALS = ['throttle', 'brake'] as const;

/** One connected device with its mapping. */
class Device {
  id;
  index;
  baseline;
  sample;
  rested;
  profile;
  calibrated;

  constructor(pad: Gamepad) {
    this.id = pad.id;
    this.index = pad.index;
    this.baseline = sampleOf(pad);
    this.sample = this.baseline;
    this.rested = { throttle: false, brake: false };
    const { profile, calibrated } = loadProfile(pad);
    this.profile = profile;
    this.calibrated = calibrated;
  }

  /** Read the values of this frame. */
  read(pad: Gamepad) {
    this.sample = sampleOf(pad);
    for (const name of PEDALS) {
      this.rested[name] ||= pedalValue(this.sample, this.profile[name]) < AT_REST;
    }
  }

  /** Return whether a control was clearly moved since the device was connected. */
  get moved() {
    const differs = (values: number[],
      base: number[]): boolean => values.some((v, i) => Math.abs(v - (base[i] ?? 0)) > MEANT);
    return differs(this.sample.axes, this.baseline.axes)
      || differs(this.sample.buttons, this.baseline.buttons);
  }

  /** Return throttle, brake and steering after calibration. */
  get axes() {
    const pedals = PEDALS.map((name) => (
      this.rested[name] ? pedalValue(this.sample, this.profile[name]) : 0));
    return [...pedals, steeringValue(this.sample, this.profile.steering)].map(
      (value) => Math.round(value * STEPS) / STEPS);
  }
}

/** All connected devices; polled in every animation frame while there is one. */
export class Gamepads {
  #devices = new Map<number, Device>();
  #active: Device | null = null;
  #pressed: boolean[] = [];
  #report;
  #frame = 0;
  #last = '';

  /**
   * @param report `changed` when the inputs of the active device change, `gear` when one of its
   *   gear buttons changed, `unplugged` when it is gone, `listed` when the list or the choice of
   *   devices changed
   */
  constructor(report: { changed: () => void; gear: (change: (reverse: boolean) => boolean) => void;
    unplugged: () => void; listed: () => void }) {
    this.#report = report;
    window.addEventListener('gamepadconnected', () => this.#poll());
    window.addEventListener('gamepaddisconnected', () => this.#poll());
    this.#poll();
  }

  /** @returns the connected devices */
  get devices(): Device[] {
    return [...this.#devices.values()];
  }

  /** @returns the device that drives when no key is held */
  get active(): Device | null {
    return this.#active;
  }

  /** @returns throttle, brake and steering of the active device */
  get axes(): number[] | null {
    return this.#active?.axes ?? null;
  }

  /** @returns left and right indicator, hazard, horn: 1 while a button of it is held */
  get lights(): number[] {
    return LIGHT_BUTTONS.map((name) => Number(
      this.#active?.profile.lights[name].some((i) => this.#pressed[i]) ?? false));
  }

  /** @returns whether the vehicle is to be put back on its lane */
  get putBack(): boolean {
    return this.#active?.profile.put_back.some((i) => this.#pressed[i]) ?? false;
  }

  /** @returns whether the lever of the active device stands in reverse */
  get gateHeld(): boolean {
    return this.#active?.profile.reverse.held.some((i) => this.#pressed[i]) ?? false;
  }

  /** Choose the device that drives; `index` of the device; null leaves only the keyboard. */
  choose(index: number | null) {
    const device = index === null ? null : this.#devices.get(index) ?? null;
    for (const other of this.#devices.values()) {
      // From here on only a new movement activates another device.
      other.baseline = other.sample;
    }
    this.#activate(device);
  }

  /**
   * Save a mapping for a device, or delete it and use the default again.
   * @param index of the device
   */
  setProfile(index: number, profile: Profile | null) {
    const device = this.#devices.get(index);
    const pad = connectedPads().find((candidate) => candidate.index === index);
    if (device && pad) {
      saveProfile(device.id, profile);
      Object.assign(device, loadProfile(pad));
      device.rested = { throttle: false, brake: false };
      this.#report.listed();
    }
  }

  /** Reload the mappings that this browser keeps. */
  reload() {
    for (const pad of connectedPads()) {
      Object.assign(this.#devices.get(pad.index) ?? {}, loadProfile(pad));
    }
    this.#report.listed();
  }

  #activate(device: Device | null) {
    this.#active = device;
    this.#pressed = device ? device.sample.buttons.map((value) => value > 0.5) : [];
    this.#report.listed();
    this.#report.changed();
  }

  #poll() {
    cancelAnimationFrame(this.#frame);
    const pads = connectedPads();
    this.#match(pads);
    for (const pad of pads) {
      this.#devices.get(pad.index)?.read(pad);
    }
    const moved = this.#active === null ? this.devices.find((device) => device.moved) : undefined;
    if (moved) {
      this.#activate(moved);
    }
    if (this.#active) {
      this.#readGear(this.#active);
      this.#reportChange(this.#active);
    }
    if (pads.length > 0) {
      this.#frame = requestAnimationFrame(() => this.#poll());
    }
  }

  #match(pads: Gamepad[]) {
    let listed = false;
    for (const pad of pads) {
      if (this.#devices.get(pad.index)?.id !== pad.id) {
        this.#devices.set(pad.index, new Device(pad));
        listed = true;
      }
    }
    for (const device of this.devices) {
      if (!pads.some((pad) => pad.index === device.index)) {
        this.#devices.delete(device.index);
        listed = true;
      }
    }
    if (this.#active && this.#devices.get(this.#active.index) !== this.#active) {
      this.#active = null;
      this.#report.unplugged();
    }
    if (listed) {
      this.#report.listed();
    }
  }

  #readGear({ sample, profile }: Device) {
    sample.buttons.forEach((value, index) => {
      const pressed = value > 0.5;
      if (pressed !== this.#pressed[index]) {
        this.#pressed[index] = pressed;
        this.#report.gear((reverse) => gearAfter(profile.reverse, reverse, index, pressed));
      }
    });
  }

  #reportChange({ axes }: Device) {
    const text = [...axes, ...this.lights, this.putBack].join();
    if (text !== this.#last) {
      this.#last = text;
      this.#report.changed();
    }
  }
}

/** List the gamepads that the browser shows now. */
export function connectedPads(): Gamepad[] {
  return [...navigator.getGamepads?.() ?? []].filter((pad) => pad !== null)
    .filter((pad) => pad.connected);
}
