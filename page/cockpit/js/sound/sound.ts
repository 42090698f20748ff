// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Sound and rumble of the vehicle whose seat this page holds, else of the followed one. */

import { inEveryFrame } from '../dom.js';
import { connectedPads } from '../driving/gamepad.js';
import { isCommand } from '../driving/focus.js';
import { recall, remember } from '../panels/memory.js';
import { Kerbs } from './kerbs.js';
import { Listener } from './listener.js';
import { actuatorOf, Rumble } from './rumble.js';
import { createSoundControl } from './sound_control.js';
import { Speaker } from './speaker.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';
import type { Heard } from './listener.js';

// Interval of updates: sound does not need every frame of the picture [ms].
const EVERY_MS = 30;
// Time after which a sound has faded [ms].
const HUSH_MS = 60;
const KEY = 'KeyM';
const VOLUME = 0.7;
const RUMBLE = 0.5;
// A longer step of time between two updates is a jump [s].
const JUMP_S = 0.5;

export type Amount = 'volume' | 'rumble'; // both from 0 to 1

/** The page's sound; in `window.crgame.sound`. */
export class Sound {
  /** Whether sound is switched on; a browser may still wait for a gesture. */
  wanted = recall('sound') === 'on';
  volume = recallShare('volume', VOLUME);
  rumble = recallShare('rumble', RUMBLE);
  /** The sounds heard now; null in silence. */
  heard: Heard | null = null;

  #store;
  #connection;
  #listener = new Listener();
  #kerbs: Kerbs | null = null;
  #speaker = new Speaker(() => this.#sendSettings());
  #motors = new Rumble();
  #control;
  #next_ms = -Infinity;
  #subject = '';
  #t = NaN;
  #sentSettings = '';
  // Whether the key M turns it on and off.
  #keys = true;

  constructor(root: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    this.#control = createSoundControl(root, this);
    window.addEventListener('pointerdown', () => this.begin(), true);
    window.addEventListener('keydown', (event) => this.#key(event), true);
    document.addEventListener('visibilitychange', () => this.#update(performance.now()));
    store.on('scene', () => {
      this.#kerbs = null;
      this.#sendSettings();
    });
    store.on('epoch', () => {
      this.#subject = '';
      this.#listener.reset();
    });
    store.on('hello', () => {
      this.#sentSettings = '';
      this.#sendSettings();
    });
    inEveryFrame((now_ms) => {
      if (now_ms >= this.#next_ms) {
        this.#next_ms = now_ms + EVERY_MS;
        this.#update(now_ms);
      }
    });
    this.#sendSettings();
  }

  /** Return whether the game lets pages sound and gamepads rumble. */
  get allowed() {
    return this.#store.scene?.sound !== 'none';
  }

  /** Return whether sound is on and can be heard. */
  get on() {
    return this.wanted && this.allowed && this.#speaker.begun;
  }

  /** Return whether the gamepad that drives, or any if none does, has motors. */
  get canRumble() {
    return this.#pads().some((pad) => actuatorOf(pad) !== null);
  }

  /** Turn the sound on or off; turning it on needs a gesture. */
  toggle() {
    this.wanted = !this.wanted;
    remember('sound', this.wanted ? 'on' : '');
    if (this.wanted && this.allowed) {
      this.#speaker.begin();
    }
    this.#update(performance.now());
    this.#sendSettings();
  }

  /** Start if it is switched on: in a gesture, or if the browser allows it without. */
  begin() {
    if (this.wanted && this.allowed && !this.#speaker.begun) {
      this.#speaker.begin();
    }
  }

  /**
   * Choose for this page only: the browser does not remember it, and M has no effect.
   * @param on starts with the next key, click or button of a gamepad
   */
  want(on: boolean) {
    this.wanted = on;
    this.#keys = false;
    this.#sendSettings();
  }

  /** @param share 0 to 1 */
  set(amount: Amount, share: number) {
    this[amount] = Math.min(Math.max(share, 0), 1);
    remember(amount, String(this[amount]));
    this.#sendSettings();
  }

  #key(event: KeyboardEvent) {
    if (event.code === KEY && !event.repeat && isCommand(event) && this.#keys && this.allowed) {
      event.preventDefault();
      this.toggle();
    } else {
      this.begin();
    }
  }

  /** Update sound and rumble to the current state. */
  #update(now_ms: number) {
    if (!this.on && this.#pads().some(({ buttons }) => buttons.some(({ pressed }) => pressed))) {
      // Browsers treat a gamepad's button as a gesture, without an event.
      this.begin();
    }
    const heard = (this.on || this.#drives) && this.#runs ? this.#hear(now_ms) : null;
    this.heard = this.on ? heard : null;
    if (heard === null) {
      this.#speaker.hush();
      this.#motors.stop();
      this.#subject = '';
      return;
    }
    const jumped = this.#jumped(heard);
    const kerb = this.#kerb(heard.own.id, now_ms, jumped);
    const trouble = { ...this.#verdictOn(heard.own.id), kerb };
    if (jumped) {
      // Another vehicle or a jump in time: a moment of silence in between.
      this.#next_ms = now_ms + HUSH_MS;
      this.#speaker.hush();
      this.#motors.stop();
      return;
    }
    if (this.on) {
      this.#speaker.play(heard, trouble, this.volume);
    } else {
      this.#speaker.hush();
    }
    const actuator = this.#drives && this.rumble > 0 ? actuatorOf(this.#pads()[0]) : null;
    if (actuator !== null) {
      this.#motors.feel(actuator, heard.own, trouble, this.rumble, now_ms);
    } else {
      this.#motors.stop();
    }
  }

  get #runs() {
    const { connected, mode, status } = this.#store;
    return (connected || mode === 'replay') && status?.run === 'running' && this.allowed
      && document.visibilityState === 'visible';
  }

  /** Return whether this page drives a seat. */
  get #drives() {
    const { driving } = window.crgame;
    return driving !== undefined && driving.seat !== null && driving.away === null;
  }

  #hear(now_ms: number) {
    const { scene } = this.#store;
    const shown = this.#store.displayed(now_ms);
    const id = window.crgame.driving?.seat ?? window.crgame.world.followed;
    return scene === null || shown === null || id === null ? null
      : this.#listener.hear(scene, shown, id);
  }

  #jumped({ t, own }: Heard) {
    const jumped = own.id !== this.#subject || !(Math.abs(t - this.#t) < JUMP_S);
    this.#subject = own.id;
    this.#t = t;
    return jumped;
  }

  /** @returns strength of the kerb crossed since the last update, 0 to 1 */
  #kerb(id: string, now_ms: number, jumped: boolean): number {
    const { scene } = this.#store;
    const index = this.#store.vehicleIndex(id);
    const shown = this.#store.displayed(now_ms);
    if (scene === null || shown === null || index < 0) {
      return 0;
    }
    this.#kerbs ??= new Kerbs(scene);
    if (jumped) {
      this.#kerbs.reset();
    }
    return this.#kerbs.over(scene.vehicles[index], shown, index);
  }

  #verdictOn(id: string) {
    const verdict = this.#store.status?.drivability?.[id];
    return { collision: verdict?.collision ?? false, offRoad: verdict?.off_road ?? false };
  }

  #pads() {
    const active = window.crgame?.driving?.gamepads.active ?? null;
    const pads = connectedPads();
    return active === null ? pads : pads.filter((pad) => pad.index === active.index);
  }

  /** Show the settings, and send them to the server, which records them. */
  #sendSettings() {
    this.#control.show();
    const told = { on: Number(this.on), volume: this.volume, rumble: this.rumble };
    const text = JSON.stringify(told);
    if (text !== this.#sentSettings && this.#connection.send({ type: 'sound', ...told })) {
      this.#sentSettings = text;
    }
  }
}

/** @param usual value if none was saved */
function recallShare(amount: Amount, usual: number) {
  const kept = Number.parseFloat(recall(amount));
  return kept >= 0 && kept <= 1 ? kept : usual;
}
