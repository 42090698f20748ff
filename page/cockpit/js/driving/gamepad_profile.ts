// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
import { LIGHT_BUTTONS } from '../lights.js';
import { local } from '../panels/memory.js';

// The mapping of a gamepad's or wheel's axes and buttons to functions, with their ranges.
/**
 * `centre` only for the steering; the raw value rises from `min` to `max`, to the right or with
 *   the pedal unless `invert`.
 */
export interface Control {
  kind: 'axis' | 'button';
  index: number;
  min: number;
  max: number;
  invert: boolean;
  deadzone: number;
  centre?: number;
}

export interface GearButtons { on: number[]; off: number[]; toggle: number[]; held: number[] }
export type LightButtons = Record<typeof LIGHT_BUTTONS[number], number[]>;

export interface Profile {
  steering: Control;
  throttle: Control;
  brake: Control;
  reverse: GearButtons;
  lights: LightButtons;
  put_back: number[];
}

export interface Sample { axes: number[]; buttons: number[] } // raw values at one time.

const PREFIX = 'crgame.gamepad.';
const NAMES = ['steering', 'throttle', 'brake'] as const;

/** Read a gamepad's raw values. */
export function sampleOf(pad: Gamepad): Sample {
  return { axes: pad.axes.map(Number), buttons: pad.buttons.map((button) => button.value) };
}

/**
 * Return the default mapping of a device that is not calibrated.
 * @param pad in its first state: Logitech pedals rest at +1.
 */
export function defaultProfile(pad: Gamepad): Profile {
  if (pad.mapping === 'standard') {
    return {
      steering: steeringOf(0, 0.08), throttle: triggerOf(7), brake: triggerOf(6),
      reverse: { on: [4], off: [5], toggle: [], held: [] },
      // Back and start, or the cross; B (circle) and A (cross).
      lights: {
        left_indicator: [8, 14], right_indicator: [9, 15], hazard: [1], horn: [0],
      },
      // Y (triangle).
      put_back: [3],
    };
  }
  const [throttle, brake] = pedalAxes(pad);
  return {
    steering: steeringOf(0, 0), throttle: pedalOf(throttle), brake: pedalOf(brake),
    reverse: { on: [5], off: [4], toggle: [], held: isLogitechWithGate(pad) ? [18] : [] },
    lights: lightsOfWheel(pad),
    // B of the wheels for the Xbox, circle of the others.
    put_back: [isLogitechForXbox(pad) ? 1 : 2],
  };
}

function steeringOf(index: number, deadzone: number): Control {
  return { kind: 'axis', index, min: -1, centre: 0, max: 1, invert: false, deadzone };
}

function triggerOf(index: number): Control {
  return { kind: 'button', index, min: 0, max: 1, invert: false, deadzone: 0.02 };
}

function pedalOf(index: number): Control {
  return { kind: 'axis', index, min: -1, max: 1, invert: true, deadzone: 0.02 };
}

function lightsOfWheel(pad: Gamepad): LightButtons {
  // LSB and RSB of the wheels for the Xbox, L2 and R2 of the others.
  const [left, right] = isLogitechForXbox(pad) ? [9, 8] : [7, 6];
  return { left_indicator: [left], right_indicator: [right], hazard: [3], horn: [0] };
}

function isLogitechForXbox(pad: Gamepad) {
  return /046d.*(c262|c26e)/i.test(pad.id);
}

function isLogitechWithGate(pad: Gamepad) {
  return /046d.*(c24f|c266)/i.test(pad.id);
}

function pedalAxes(pad: Gamepad) {
  // G920 and the Xbox version of the G923 have the clutch on the last axis, the others on 1.
  if (isLogitechForXbox(pad)) {
    return [1, 2];
  }
  if (isLogitechWithGate(pad)) {
    return [2, 3];
  }
  const resting = [...pad.axes.keys()].filter((i) => i > 0 && pad.axes[i] > 0.9);
  if (resting.length >= 2) {
    return resting.length === 2 ? resting : resting.slice(1, 3);
  }
  return pad.axes.length >= 4 ? [2, 3] : [1, 2];
}

/** Load the calibrated mapping of a device, or its default. */
export function loadProfile(pad: Gamepad): { profile: Profile; calibrated: boolean } {
  const text = local.get(PREFIX + pad.id);
  if (text !== null) {
    try {
      const profile = JSON.parse(text);
      if (isProfile(profile)) {
        // Old profiles have no indicators and no button to be put back.
        const { lights, put_back } = defaultProfile(pad);
        return { profile: { ...profile, lights: isLights(profile.lights) ? profile.lights : lights,
          put_back: Array.isArray(profile.put_back) ? profile.put_back : put_back },
        calibrated: true };
      }
    } catch (error) {
      console.warn(`the calibration of ${pad.id} cannot be read and is not used: ${error}`);
    }
  }
  return { profile: defaultProfile(pad), calibrated: false };
}

/** Save a calibrated mapping in this browser; `id` of the gamepad; `profile`: null forgets it. */
export function saveProfile(id: string, profile: Profile | null) {
  if (profile === null) {
    local.remove(PREFIX + id);
  } else {
    local.set(PREFIX + id, JSON.stringify(profile));
  }
}

/**
 * Return this browser's stored mappings for a page whose address has another port.
 * @returns JSON of each, by the gamepad's id
 */
export function keptProfiles(): Record<string, string> {
  return Object.fromEntries(local.keys(PREFIX).map(
    (key) => [key.slice(PREFIX.length), local.get(key) ?? '']));
}

/**
 * Save the mappings of another page of this machine; invalid ones are left out.
 * @param profiles JSON of each, by the gamepad's id
 */
export function keepProfiles(profiles: Record<string, unknown>) {
  for (const [id, text] of Object.entries(profiles)) {
    try {
      const profile = JSON.parse(String(text));
      if (isProfile(profile)) {
        saveProfile(id, profile);
      }
    } catch (error) {
      console.warn(`the calibration of ${id} cannot be read and is not used: ${error}`);
    }
  }
}

/** @param profile from storage */
function isProfile(profile: unknown): profile is Profile {
  const found = profile as Partial<Profile> | null;
  const numbers = (control: Control, names: (keyof Control)[]) => (
    names.every((name) => Number.isFinite(control[name])));
  return NAMES.every((name) => {
    const control = found?.[name];
    return (control?.kind === 'axis' || control?.kind === 'button')
      && numbers(control, ['index', 'min', 'max', 'deadzone'])
      && (name !== 'steering' || numbers(control, ['centre']));
  }) && (['on', 'off', 'toggle', 'held'] as const).every(
    (name) => Array.isArray(found?.reverse?.[name]));
}

function isLights(lights: Partial<LightButtons> | undefined) {
  return LIGHT_BUTTONS.every((name) => Array.isArray(lights?.[name]));
}

/** Read one raw value of a sample; return NaN if the device has no such control. */
export function rawValue(sample: Sample, control: Pick<Control, 'kind' | 'index'>): number {
  const values = control.kind === 'axis' ? sample.axes : sample.buttons;
  return values[control.index] ?? NaN;
}

/** Return a pedal's share of its travel: 0 (released) to 1. */
export function pedalValue(sample: Sample, control: Control): number {
  const share = (rawValue(sample, control) - control.min) / (control.max - control.min);
  return beyond(control.invert ? 1 - share : share, control.deadzone);
}

/** Return the steering of a sample: -1 to 1, positive to the left. */
export function steeringValue(sample: Sample, control: Control): number {
  const centre = control.centre ?? NaN;
  const offset = rawValue(sample, control) - centre;
  const side = offset > 0 ? control.max - centre : centre - control.min;
  const size = beyond(Math.abs(offset) / side, control.deadzone);
  return size === 0 ? 0 : size * Math.sign(offset) * (control.invert ? 1 : -1);
}

function beyond(share: number, deadzone: number) {
  // Stretched beyond the dead zone, so that there is no jump at its edge; NaN counts as rest.
  const size = (share - deadzone) / (1 - deadzone);
  return Number.isFinite(size) ? Math.min(1, Math.max(0, size)) : 0;
}

/**
 * Return the gear after a button changed.
 * @param reverse the gear before.
 * @param index of the button.
 * @param pressed whether it is pressed now.
 * @returns whether reverse is selected.
 */
export function gearAfter(buttons: GearButtons, reverse: boolean, index: number,
  pressed: boolean): boolean {
  if (buttons.held.includes(index)) {
    return pressed;
  }
  if (!pressed) {
    return reverse;
  }
  if (buttons.toggle.includes(index)) {
    return !reverse;
  }
  return buttons.on.includes(index) || (reverse && !buttons.off.includes(index));
}
