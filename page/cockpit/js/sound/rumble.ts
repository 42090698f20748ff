// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The rumble of a gamepad with motors: ground, kerbs, collisions, hard braking. */

import { hardBraking, impact, roughness } from './levels.js';

import type { Driven } from './listener.js';
import type { Trouble } from './sound_graph.js';

// An effect lasts longer than the time to the next, so that the motors run evenly [ms].
const EVERY_MS = 80;
const EFFECT_MS = 160;
const KERB_MS = 150;
const COLLISION_MS = 450;

export interface Magnitudes { strong: number; weak: number } // of the two motors, 0 to 1
export interface Pulse { magnitude: number; until_ms: number }

/** A converter of the own vehicle's state into magnitudes of the motors. */
export class Feeling {
  #trouble: Trouble | null = null;
  #pulse: Pulse = { magnitude: 0, until_ms: -Infinity };
  #beat = false;

  /** Clear the past, which is not felt later. */
  reset() {
    this.#trouble = null;
    this.#pulse = { magnitude: 0, until_ms: -Infinity };
  }

  of({ speed, deceleration }: Pick<Driven, 'speed' | 'deceleration'>, trouble: Trouble,
    now_ms: number): Magnitudes {
    const before = this.#trouble ?? trouble;
    this.#trouble = trouble;
    if (trouble.collision && !before.collision) {
      this.#pulse = { magnitude: impact(speed), until_ms: now_ms + COLLISION_MS };
    } else if (trouble.offRoad !== before.offRoad || trouble.kerb > 0) {
      const edge = trouble.offRoad !== before.offRoad ? 1 : trouble.kerb;
      this.#pulse = { magnitude: 0.7 * edge * impact(speed), until_ms: now_ms + KERB_MS };
    }
    const pulse = now_ms < this.#pulse.until_ms ? this.#pulse.magnitude : 0;
    const rough = trouble.offRoad ? roughness(speed) : 0;
    // The pedal of an antilock brake beats: here with every second effect.
    this.#beat = !this.#beat;
    const brakes = hardBraking(deceleration, speed) * (this.#beat ? 1 : 0.3);
    return {
      strong: Math.max(pulse, 0.4 * rough, 0.3 * brakes),
      weak: Math.max(pulse, 0.6 * rough, 0.7 * brakes),
    };
  }
}

/** The motors of one gamepad after another. */
export class Rumble {
  #feeling = new Feeling();
  #running: GamepadHapticActuator | null = null;
  #next_ms = -Infinity;
  // Strongest kerb between two effects.
  #kerb = 0;

  /** Play the effects on a gamepad; `strength`: 0 to 1. */
  feel(actuator: GamepadHapticActuator, own: Pick<Driven, 'speed' | 'deceleration'>,
    trouble: Trouble, strength: number, now_ms: number) {
    if (this.#running !== null && this.#running !== actuator) {
      this.stop();
    }
    this.#kerb = Math.max(this.#kerb, trouble.kerb);
    if (now_ms < this.#next_ms) {
      return;
    }
    this.#next_ms = now_ms + EVERY_MS;
    const { strong, weak } = this.#feeling.of(own, { ...trouble, kerb: this.#kerb }, now_ms);
    this.#kerb = 0;
    if (strength * Math.max(strong, weak) < 0.01) {
      this.#still();
      return;
    }
    this.#running = actuator;
    // A browser without support, or without its gamepad, rejects; this is ignored.
    actuator.playEffect('dual-rumble', {
      startDelay: 0, duration: EFFECT_MS, strongMagnitude: strength * strong,
      weakMagnitude: strength * weak,
    }).catch(() => {});
  }

  /** Stop the motors and clear the past. */
  stop() {
    this.#feeling.reset();
    this.#kerb = 0;
    this.#next_ms = -Infinity;
    this.#still();
  }

  #still() {
    this.#running?.reset().catch(() => {});
    this.#running = null;
  }
}

/** @returns null if the gamepad or the browser has none */
export function actuatorOf(pad: Gamepad | undefined): GamepadHapticActuator | null {
  const actuator = pad?.vibrationActuator ?? null;
  return typeof actuator?.playEffect === 'function' ? actuator : null;
}
