// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Gamepads and wheels of the Gamepad API: the active device and its inputs. */

import { LIGHT_BUTTONS } from '../lights.js';
import {
  gearAfter, loadProfile, pedalValue, sampleOf, saveProfile, steeringValue,
} from './gamepad_profile.js';

/** @import { Control, Profile } from './gamepad_profile.js' */

// A larger change of any axis or button is intended and not sensor noise.
const MEANT = 0.2;
// A pedal counts only after it was seen at rest: for axes that have not moved since the device
// was plugged in, browsers report 0, which is half of a wheel's pedal travel.
const AT_REST = 0.1;
const STEPS = 1000;
const PEDALS = /** @type {const} */ (['throttle', 'brake']);

/** One connected device with its mapping. */
class Device {
  /** @param {Gamepad} pad */
  constructor(pad) {
    this.id = pad.id;
    this.index = pad.index;
    this.baseline = sampleOf(pad);
    this.sample = this.baseline;
    this.rested = { throttle: false, brake: false };
    const { profile, calibrated } = loadProfile(pad);
    this.profile = profile;
    this.calibrated = calibrated;
  }

  /**
   * Read the values of this frame.
   *
   * @param {Gamepad} pad
   */
  read(pad) {
    this.sample = sampleOf(pad);
    for (const name of PEDALS) {
      this.rested[name] ||= pedalValue(this.sample, this.profile[name]) < AT_REST;
    }
  }

  /** Return whether a control was clearly moved since the device was connected. */
  get moved() {
    /** @type {(values: number[], base: number[]) => boolean} */
    const differs = (values, base) => values.some((v, i) => Math.abs(v - (base[i] ?? 0)) > MEANT);
    return differs(this.sample.axes, this.baseline.axes)
      || differs(this.sample.buttons, this.baseline.buttons);
  }

  /** Return throttle, brake and steering after calibration. */
  get axes() {
    const { throttle, brake, steering } = this.profile;
    /** @type {(name: 'throttle'|'brake', control: Control) => number} */
    const pedal = (name, control) => (
      this.rested[name] ? pedalValue(this.sample, control) : 0);
    return [pedal('throttle', throttle), pedal('brake', brake),
      steeringValue(this.sample, steering)].map((v) => Math.round(v * STEPS) / STEPS);
  }
}

/** All connected devices; polled in every animation frame while there is one. */
export class Gamepads {
  /** @type {Map<number, Device>} */
  #devices = new Map();
  /** @type {Device|null} */
  #active = null;
  /** @type {boolean[]} */
  #pressed = [];
  #report;
  #frame = 0;
  #last = '';

  /**
   * @param {{changed: () => void, gear: (change: (reverse: boolean) => boolean) => void,
   *   unplugged: () => void, listed: () => void}} report `changed` when the inputs
   *   of the active device change, `gear` when one of its gear buttons changed, `unplugged` when
   *   it is gone, `listed` when the list or the choice of devices changed
   */
  constructor(report) {
    this.#report = report;
    window.addEventListener('gamepadconnected', () => this.#poll());
    window.addEventListener('gamepaddisconnected', () => this.#poll());
    this.#poll();
  }

  /** @returns {Device[]} the connected devices */
  get devices() {
    return [...this.#devices.values()];
  }

  /** @returns {Device|null} the device that drives when no key is held */
  get active() {
    return this.#active;
  }

  /** @returns {number[]|null} throttle, brake and steering of the active device */
  get axes() {
    return this.#active?.axes ?? null;
  }

  /** @returns {number[]} left and right indicator, hazard, horn: 1 while a button of it is held */
  get lights() {
    return LIGHT_BUTTONS.map((name) => Number(
      this.#active?.profile.lights[name].some((i) => this.#pressed[i]) ?? false));
  }

  /** @returns {boolean} whether the vehicle is to be put back on its lane */
  get putBack() {
    return this.#active?.profile.put_back.some((i) => this.#pressed[i]) ?? false;
  }

  /** @returns {boolean} whether the lever of the active device stands in reverse */
  get gateHeld() {
    return this.#active?.profile.reverse.held.some((i) => this.#pressed[i]) ?? false;
  }

  /**
   * Choose the device that drives.
   *
   * @param {number|null} index of the device; null leaves only the keyboard
   */
  choose(index) {
    const device = index === null ? null : this.#devices.get(index) ?? null;
    for (const other of this.#devices.values()) {
      // From here on only a new movement activates another device.
      other.baseline = other.sample;
    }
    this.#activate(device);
  }

  /**
   * Save a mapping for a device, or delete it and use the default again.
   *
   * @param {number} index of the device
   * @param {Profile|null} profile
   */
  setProfile(index, profile) {
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

  /** @param {Device|null} device */
  #activate(device) {
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
    if (this.#active === null) {
      this.#activateMoved();
    }
    if (this.#active) {
      this.#readGear(this.#active);
      this.#reportChange(this.#active);
    }
    if (pads.length > 0) {
      this.#frame = requestAnimationFrame(() => this.#poll());
    }
  }

  /** @param {Gamepad[]} pads */
  #match(pads) {
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

  #activateMoved() {
    const moved = this.devices.find((device) => device.moved);
    if (moved) {
      this.#activate(moved);
    }
  }

  /** @param {Device} device */
  #readGear({ sample, profile }) {
    sample.buttons.forEach((value, index) => {
      const pressed = value > 0.5;
      if (pressed !== this.#pressed[index]) {
        this.#pressed[index] = pressed;
        this.#report.gear((reverse) => gearAfter(profile.reverse, reverse, index, pressed));
      }
    });
  }

  /** @param {Device} device */
  #reportChange({ axes }) {
    const text = [...axes, ...this.lights, this.putBack].join();
    if (text !== this.#last) {
      this.#last = text;
      this.#report.changed();
    }
  }
}

/**
 * List the gamepads that the browser shows now.
 *
 * @returns {Gamepad[]}
 */
export function connectedPads() {
  return [...navigator.getGamepads?.() ?? []].filter((pad) => pad !== null)
    .filter((pad) => pad.connected);
}
