// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The instruments and keys over the world, of the driven or the watched vehicle. */

import { element, inEveryFrame, setAttribute, setText } from '../dom.js';
import { VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { LIGHT, shining } from '../lights.js';
import { DEGREES, KMH } from '../units.js';
import { pedalBar, steeringBar, steeringWheel } from './gauges.js';
import { SpeedLimits } from './speed_limit.js';

import type { Scene, SceneVehicle } from '../messages.js';
import type { Store } from '../store.js';
import type { Keyboard } from './keyboard.js';

// Numbers that change faster than this cannot be read [ms].
const NUMBERS_EVERY_MS = 100;
const LIMIT_EVERY_MS = 300;
const STANDSTILL = 0.05;
// Tolerance, so that rounding does not make a limit look exceeded [m/s].
const LIMIT_TOLERANCE = 0.3;

/** Texts that explain why the controls are released, by reason. */
const AWAY_TEXTS = Object.freeze({
  hidden: 'Hands off: this page is hidden.',
  focus: 'Hands off: click into this page to drive on.',
  dialog: 'Hands off while a dialog is open.',
  unplugged: 'The input device is unplugged: press a driving key, or plug it in and move it.',
} as Record<string, string>);

export interface Subject {
  id: string | null;
  driven: boolean;
  away: string | null;
  lost: string;
  reverse: boolean;
  driver: string;
}

/** The overlay in `#hud`. */
export class Hud {
  #root;
  #store;
  #subject;
  #keyboard;
  #parts;
  #limits = new SpeedLimits(null);
  #numbersAt_ms = -Infinity;
  #limitAt_ms = -Infinity;
  #vehicleId: string | null = null;
  #vehicle: SceneVehicle | null = null;

  /**
   * @param subject the vehicle to show, its inputs, and any fault of the connection
   * @param keyboard its keys are drawn and can be pressed by touch
   */
  constructor(root: HTMLElement, store: Store, subject: () => Subject, keyboard: Keyboard) {
    this.#root = root;
    this.#store = store;
    this.#subject = subject;
    this.#keyboard = keyboard;
    this.#parts = buildParts(keyboard);
    root.replaceChildren(this.#parts.banner, this.#parts.board);
    root.classList.add('hud');
    store.on('scene', (scene) => this.#setScene(scene));
    store.on('events', ({ fired }) => this.#limits.applyEvents(fired));
    this.#setScene(store.scene);
    inEveryFrame((now_ms) => this.#draw(now_ms));
  }

  #setScene(scene: Scene | null) {
    this.#limits = new SpeedLimits(scene);
    this.#limits.applyEvents(this.#store.fired);
    this.#vehicleId = null;
  }

  #draw(now_ms: number) {
    const subject = this.#subject();
    const index = subject.id === null ? -1 : this.#store.vehicleIndex(subject.id);
    const row = index < 0 ? null : this.#row(index, now_ms);
    setAttribute(this.#root, 'hidden', row === null);
    if (row === null) {
      return;
    }
    if (subject.id !== this.#vehicleId) {
      this.#vehicleId = subject.id;
      this.#vehicle = this.#store.scene?.vehicles[index] ?? null;
      this.#numbersAt_ms = this.#limitAt_ms = -Infinity;
    }
    this.#show(row, subject);
    this.#parts.lights.show(row[VEHICLE.lights], this.#store.displayed(now_ms)?.t ?? 0);
    if (now_ms - this.#numbersAt_ms >= NUMBERS_EVERY_MS) {
      this.#numbersAt_ms = now_ms;
      this.#write(row, subject);
    }
    if (now_ms - this.#limitAt_ms >= LIMIT_EVERY_MS) {
      this.#limitAt_ms = now_ms;
      this.#writeLimit(row);
    }
  }

  #row(index: number, now_ms: number) {
    const values = this.#store.displayed(now_ms)?.vehicles;
    const from = index * VEHICLE_WIDTH;
    return values && values.length >= from + VEHICLE_WIDTH && Number.isFinite(values[from])
      ? values.subarray(from, from + VEHICLE_WIDTH) : null;
  }

  /** Update the moving parts, in every animation frame. */
  #show(row: Float64Array, { driven, reverse }: Subject) {
    const p = this.#parts;
    const [throttleKey, brakeKey, left, right] = driven ? this.#keyboard.keys : [0, 0, 0, 0];
    const command = row[VEHICLE.steering];
    p.throttle.show(row[VEHICLE.throttle], throttleKey === 1);
    p.brake.show(row[VEHICLE.brake], brakeKey === 1);
    p.steering.show(command, left === 1, right === 1);
    // A planner sends no steering command: the wheel then shows the front wheels' angle.
    p.wheel.turn(Number.isFinite(command) ? command
      : row[VEHICLE.steering_angle] / (this.#vehicle?.max_steering_angle || 1));
    setAttribute(p.keycaps.node, 'hidden', !driven);
    setAttribute(this.#root, 'data-driven', driven);
    if (driven) {
      p.keycaps.show(reverse);
    }
  }

  /** Update the numbers, at a lower rate. */
  #write(row: Float64Array, subject: Subject) {
    const p = this.#parts;
    const speed = row[VEHICLE.speed];
    setText(p.kmh, String(Math.round(Math.abs(speed) * KMH)));
    setText(p.ms, `${signed(speed, 1)} m/s`);
    setText(p.acceleration, `${signed(row[VEHICLE.acceleration], 1)} m/s²`);
    const [gear, asked] = gears(speed, row[VEHICLE.reverse]);
    setText(p.gear, gear === asked ? gear : `${gear}→${asked}`);
    setAttribute(p.gear, 'data-gear', gear);
    setText(p.angle, `${signed(row[VEHICLE.steering_angle] * DEGREES, 1)}°`);
    const command = row[VEHICLE.steering];
    setText(p.command, Number.isFinite(command) ? `${signed(100 * command, 0)} %` : '–');
    p.throttle.write(row[VEHICLE.throttle]);
    p.brake.write(row[VEHICLE.brake]);
    setText(p.who, subject.driven ? `You drive ${subject.id}` : `Watching ${subject.id}`);
    setText(p.device, subject.driver);
    setAttribute(p.board, 'data-role', this.#vehicle?.role ?? null);
    const text = subject.driven && subject.away ? AWAY_TEXTS[subject.away] ?? '' : subject.lost;
    setText(p.banner, text);
    setAttribute(p.banner, 'data-on', text !== '');
  }

  #writeLimit(row: Float64Array) {
    const limit = this.#limits.at(row[VEHICLE.x], row[VEHICLE.y], row[VEHICLE.yaw]);
    const { limit: sign } = this.#parts;
    setAttribute(sign, 'data-on', limit !== null);
    setAttribute(sign, 'data-over', limit !== null
      && Math.abs(row[VEHICLE.speed]) > limit + LIMIT_TOLERANCE);
    if (limit !== null) {
      setText(sign, String(Math.round(limit * KMH)));
      setAttribute(sign, 'aria-label', `Speed limit ${Math.round(limit * KMH)} km/h`);
    }
  }
}

/** Return the current gear and the requested one, which is engaged only at standstill. */
function gears(speed: number, reverse: number): [gear: string, asked: string] {
  const asked = Number.isFinite(reverse) ? (reverse > 0.5 ? 'R' : 'D') : null;
  const gear = Math.abs(speed) < STANDSTILL ? asked ?? 'D' : speed < 0 ? 'R' : 'D';
  return [gear, asked ?? gear];
}

/** Format a number with its sign, without a sign if it rounds to zero. */
function signed(value: number, digits: number) {
  if (!Number.isFinite(value)) {
    return '–';
  }
  const text = Math.abs(value).toFixed(digits);
  if (Number(text) === 0) {
    return text;
  }
  return `${value < 0 ? '−' : '+'}${text}`;
}

function buildParts(keyboard: Keyboard) {
  const span = (name: string,
    title?: string): HTMLElement => element('span', { class: `hud-${name}`, title });
  const parts = {
    kmh: span('kmh', 'Speed'), ms: span('ms', 'Signed speed'), gear: span('gear', 'Gear'),
    acceleration: span('acceleration', 'Acceleration'), who: span('who'), device: span('device'),
    seen: span('seen', 'How many of the objects within sensor range its planner is told of'),
    angle: span('angle', 'Angle of the front wheels, positive to the left'),
    command: span('command', 'Steering command, positive to the left'),
    limit: element('span', { class: 'hud-limit', role: 'img', title: 'Speed limit' }),
    throttle: pedalBar('throttle', 'Throttle'), brake: pedalBar('brake', 'Brake'),
    steering: steeringBar(), wheel: steeringWheel(), keycaps: new Keycaps(keyboard),
    lights: lightSigns(),
    banner: element('div', { class: 'hud-banner', role: 'status', 'aria-live': 'polite' }),
  };
  const board = element('div', { class: 'hud-board' },
    element('div', { class: 'hud-title' }, parts.who, parts.device, parts.seen),
    element('div', { class: 'hud-row' },
      element('div', { class: 'hud-pedals' }, parts.brake.node, parts.throttle.node),
      element('div', { class: 'hud-speed' }, parts.lights.node,
        element('div', { class: 'hud-main' }, parts.kmh,
          element('span', { class: 'hud-unit', text: 'km/h' })),
        element('div', { class: 'hud-small' }, parts.ms, parts.acceleration)),
      element('div', { class: 'hud-signs' }, parts.gear, parts.limit),
      element('div', { class: 'hud-steering' }, parts.wheel.node,
        element('div', { class: 'hud-turn' }, element('div', { class: 'hud-angles' },
          label('Wheels', parts.angle), label('Steering', parts.command)), parts.steering.node)),
      parts.keycaps.node));
  return { ...parts, board };
}

function label(text: string, value: HTMLElement) {
  return element('div', { class: 'hud-labelled' },
    element('span', { class: 'bar-label', text }), value);
}

const SIGNS: [name: 'left' | 'horn' | 'right', sign: string, title: string][] = [
  ['left', '◄', 'Left indicator'], ['horn', '♪', 'Horn'], ['right', '►', 'Right indicator'],
];

/** Make the signs over the speed, lit like the vehicle's lights. */
function lightSigns() {
  const signs = SIGNS.map(([name, text, title]) => ({
    name, title, node: element('span', { class: `sign sign-${name}`, role: 'img', title, text }),
  }));
  return {
    node: element('div', { class: 'hud-lights' }, ...signs.map(({ node }) => node)),
    /** Update the signs; `lights` as the vehicle's state has them; `t`: simulation time [s]. */
    show(lights: number, t: number) {
      const shines = shining(lights, t);
      for (const { name, title, node } of signs) {
        // Screen readers are told once, not at each blink.
        setAttribute(node, 'aria-label', `${title} ${(lights & LIGHT[name]) > 0 ? 'on' : 'off'}`);
        setAttribute(node, 'data-on', shines[name]);
      }
    },
  };
}

// The place of a key, its label, the other key with the same function, and a sign beside it.
const CAPS: [code: string, text: string, twin: string | null, title: string, sign?: string][] = [
  ['KeyW', 'W', 'ArrowUp', 'Throttle'], ['KeyR', 'R', null, 'Reverse gear'],
  ['KeyA', 'A', 'ArrowLeft', 'Left'], ['KeyS', 'S', 'ArrowDown', 'Brake'],
  ['KeyD', 'D', 'ArrowRight', 'Right'], ['Space', 'Space', null, 'Brake'],
  ['Comma', ',', null, 'Left indicator', '◄'], ['Period', '.', null, 'Right indicator', '►'],
  ['KeyJ', 'J', null, 'Hazard lights', '◄►'], ['KeyG', 'G', null, 'Horn', '♪'],
];

/** The drawn keys; `node` goes into the page. */
class Keycaps {
  #caps = new Map<string, HTMLElement>();
  #keyboard;
  node;

  /** @param keyboard has the held keys, and receives touch presses */
  constructor(keyboard: Keyboard) {
    this.#keyboard = keyboard;
    for (const [code, text, , title, sign] of CAPS) {
      const lift = () => keyboard.lift(code);
      this.#caps.set(code, element('kbd', { class: `cap cap-${code}`, title,
        text: sign === undefined ? text : `${text} ${sign}`, on: {
        pointerdown: (event) => {
          event.preventDefault();
          // A finger that slides off the key still holds it.
          (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
          keyboard.press(code);
        },
        pointerup: lift, pointercancel: lift, lostpointercapture: lift,
        contextmenu: (event) => event.preventDefault(),
      } }));
    }
    this.node = element('div', { class: 'keycaps', role: 'group',
      'aria-label': 'Keys: W throttle, A left, S brake, D right, space brake, R reverse, '
        + 'comma and period indicators, J hazard lights, G horn, Backspace back on the lane '
        + 'after a contact' },
    ...this.#caps.values());
    this.#readLayout();
  }

  /** Light the held keys; `reverse`: whether the reverse gear is requested. */
  show(reverse: boolean) {
    for (const [code, , twin] of CAPS) {
      const on = code === 'KeyR' ? reverse
        : this.#keyboard.isHeld(code) || (twin !== null && this.#keyboard.isHeld(twin));
      setAttribute(this.#cap(code), 'data-on', on);
    }
  }

  #cap(code: string): HTMLElement {
    return this.#caps.get(code) as HTMLElement;
  }

  /** Write the labels of the user's keyboard layout, if the browser knows it. */
  async #readLayout() {
    const layout = await navigator.keyboard?.getLayoutMap?.().catch(() => undefined);
    for (const [code, text, , , sign] of CAPS) {
      const key = layout?.get(code)?.toUpperCase() ?? text;
      setText(this.#cap(code), sign === undefined ? key : `${key} ${sign}`);
    }
  }
}
