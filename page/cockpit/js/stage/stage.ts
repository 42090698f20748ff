// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The bare page of a driver: it takes its seat, and talks with the page that frames it. */

import { element, setAttribute, setText } from '../dom.js';
import { languageOf, WORDS } from '../driver_words.js';
import { keepProfiles } from '../driving/gamepad_profile.js';
import { countPictures } from '../view_report.js';
import { readStage } from './stage_address.js';

import type { Connection } from '../connection.js';
import type { StageTrouble } from '../driver_words.js';
import type { Store } from '../store.js';
import type { StageAddress } from './stage_address.js';
import type { StageOrder, StageState, StageView } from './stage_messages.js';

// Least interval of reports to the framing page [ms].
const EVERY_MS = 100;
// Time after which a refused seat is requested again [ms].
const CLAIM_EVERY_MS = 1000;

/** A stage; in `window.crgame.stage`. */
export class Stage {
  address;
  #store;
  #connection;
  #link;
  #words = WORDS.en;
  #line = element('div', { class: 'stage-line', role: 'alert', hidden: true });
  #role = '';
  #claimed_ms = -Infinity;
  #left_ms = -Infinity;
  #refusal = '';
  #failed = '';
  #missing3d = false;
  // Pictures of the view before the present epoch; NaN until the address is applied.
  #before = NaN;
  // Epoch for which the driver has reported ready.
  #ready = { wanted: false, epoch: -1, sent: false };

  /** @param root gets the line */
  constructor(root: HTMLElement, store: Store, connection: Connection, address: StageAddress) {
    this.address = address;
    this.#store = store;
    this.#connection = connection;
    this.#link = new FrameLink(store, (order) => this.#obey(order));
    root.append(this.#line);
    this.#speak();
    document.addEventListener('contextmenu', (event) => event.preventDefault());
    store.on('notice', ({ level, text }) => {
      this.#failed = level === 'error' ? text : this.#failed;
    });
    store.on('hello', () => {
      // Another server may assign the same id, and does not know the role.
      this.#role = '';
      this.#claimRole();
    });
    store.on('epoch', () => { this.#before = this.#begun ? countPictures() : NaN; });
    store.on('scene', () => this.#speak());
    store.on(['seats', 'connection'], () => this.#update());
    this.#claimRole();
    setInterval(() => this.#update(), EVERY_MS);
  }

  /** Apply the address, once all parts are loaded. */
  async begin() {
    const { names, plans, map, mirrors, view, change, fieldOfView_deg, sound } = this.address;
    const { world, view3d } = window.crgame;
    for (const [layer, on] of Object.entries({ labels: names, plans, goals: plans })) {
      world.setLayer(layer, on);
    }
    this.#speak();
    window.crgame.sound?.want(sound);
    if (view3d !== undefined) {
      view3d.keys = change;
      view3d.settings.fix({ plans, mirrors, inset: map, sharp: false }, fieldOfView_deg);
      if (view !== 'map') {
        view3d.viewpoint = view;
        this.#missing3d = !await view3d.show(true);
      }
    }
    // Until now, the page showed nothing: neither the map nor what the address hides.
    document.documentElement.dataset.begun = '';
    this.#before = countPictures();
    world.redraw();
    this.#update();
  }

  get #begun() {
    return !Number.isNaN(this.#before);
  }

  /** Use the language of the address, or else of the game, once it is known. */
  #speak() {
    const language = languageOf(window.location.search, this.#store.scene?.language);
    this.#words = WORDS[language];
    document.documentElement.lang = language;
    for (const name of ['throttle', 'brake'] as const) {
      const label = document.querySelector(`.pedal-${name} .bar-label`);
      if (label !== null) {
        setText(label, this.#words[name]);
      }
    }
  }

  /** Take the role of a driver, so that the server refuses all other rights. */
  #claimRole() {
    const { me, mode } = this.#store;
    if (me.id !== '' && mode === 'live' && this.#role !== me.id) {
      this.#role = me.id;
      this.#claimed_ms = -Infinity;
      this.#connection.request({ type: 'role', role: 'drive' }).then(() => this.#update());
    }
  }

  #obey(order: StageOrder) {
    if (order.kind === 'calibrations') {
      keepProfiles(order.profiles);
      window.crgame.driving?.gamepads.reload();
      return;
    }
    window.focus();
    if (order.kind === 'ready') {
      window.crgame.sound?.begin();
      this.#ready = { wanted: order.ready, epoch: this.#store.epoch, sent: false };
      this.#update();
    }
  }

  /** Take the seat while it is free, show any trouble, and report to the framing page. */
  #update() {
    const seat = this.#store.seats[this.address.seat];
    this.#leave();
    if (this.#rides && window.crgame.world.followed !== this.address.seat) {
      window.crgame.world.follow(this.address.seat, true);
    }
    if (this.#store.connected && !this.#rides && seat !== undefined && seat.holder === null
        && !this.#store.rights.directs
        && performance.now() - this.#claimed_ms > CLAIM_EVERY_MS) {
      this.#claim();
    }
    this.#reportReady();
    const trouble = this.#trouble();
    const text = trouble === null ? '' : this.#words[trouble];
    setText(this.#line, text);
    setAttribute(this.#line, 'hidden', text === '');
    const state = this.#state(trouble);
    document.documentElement.dataset.stage = state.view;
    document.documentElement.toggleAttribute('data-missing3d', state.missing3d);
    this.#link.send(state);
  }

  /**
   * Leave another vehicle that the same person still has from an earlier stage, and an AV that
   * was taken over in the run before: its planner starts the next run.
   */
  #leave() {
    const { own, connected } = this.#store;
    const left = own.find((id) => id !== this.address.seat || this.#staysBehind);
    if (connected && left !== undefined && performance.now() - this.#left_ms > CLAIM_EVERY_MS) {
      this.#left_ms = performance.now();
      if (left === this.address.seat) {
        window.crgame.driving?.release();
      } else {
        this.#connection.request({ type: 'release', seat: left });
      }
    }
  }

  async #claim() {
    this.#claimed_ms = performance.now();
    const { driving } = window.crgame;
    if (driving !== undefined) {
      const { ok, text } = await driving.claim(this.address.seat);
      this.#refusal = ok ? '' : text;
    }
  }

  /** Report ready; each run needs a new report. */
  async #reportReady() {
    const ready = this.#ready;
    const { epoch, seats } = this.#store;
    if (ready.epoch !== epoch || ready.sent || !this.#seated
        || seats[this.address.seat]?.ready === ready.wanted) {
      return;
    }
    ready.sent = true;
    const { ok, text } = await this.#connection.request(
      { type: 'ready', seat: this.address.seat, ready: ready.wanted });
    this.#refusal = ok ? '' : text;
  }

  /** Return whether it is in an AV whose planner drives. */
  get #rides() {
    return !this.#has && this.#isAutonomous;
  }

  get #seated() {
    return this.#has && !this.#staysBehind;
  }

  get #has() {
    return window.crgame.driving?.seat === this.address.seat;
  }

  get #isAutonomous() {
    return this.#store.vehicle(this.address.seat)?.role === 'autonomous';
  }

  /** Return whether it still has the AV that it took over in the run before this one. */
  get #staysBehind() {
    return this.#has && this.#isAutonomous && this.#store.status?.n === 0;
  }

  /** @returns the reason why the driver cannot drive, null for none */
  #trouble(): StageTrouble | null {
    const { connected, mode, status, scene, seats, me } = this.#store;
    const { seat } = this.address;
    const { driving } = window.crgame;
    if (!connected) {
      return status?.run === 'ended' ? null : this.#role === '' ? 'connecting' : 'lost';
    }
    if (mode === 'replay') {
      return 'recording';
    }
    if (this.#rides) {
      return null;
    }
    if (!this.#seated) {
      const other = seats[seat]?.holder ?? null;
      const absent = scene !== null && this.#store.vehicle(seat) === undefined;
      return absent ? 'no_seat' : other !== null && other !== me.id ? 'taken'
        : this.#failed !== '' ? 'failed' : 'connecting';
    }
    if (status?.run === 'ended') {
      return null;
    }
    const away = driving?.away;
    // Before a drive, the framing page shows its questions and has the focus.
    const isAsked = window.parent !== window && status?.run !== 'running' && !seats[seat]?.ready;
    return away === 'unplugged' || (away === 'focus' && !isAsked) ? away
      : status?.seats_lost?.[seat] && status.run === 'running' ? 'silent' : null;
  }

  #state(trouble: StageTrouble | null): StageState {
    const { connected, status, epoch, seats, people, me, round_trip_ms } = this.#store;
    const { driving } = window.crgame;
    const { seat } = this.address;
    const own = people.find(({ client }) => client === me.id);
    const time_s = this.#time_s;
    const more = this.#failed || this.#refusal;
    return {
      seat, seated: this.#seated, rides: this.#rides, connected, run: status?.run ?? null,
      reason: status?.run === 'ended' ? status.reason ?? '' : '', epoch, time_s,
      ready: this.#seated && Boolean(seats[seat]?.ready),
      countdown_s: connected ? status?.countdown_s ?? 0 : 0,
      view: this.#view, drawn: this.#begun && countPictures() > this.#before,
      missing3d: this.#missing3d, sound: this.#sound,
      hasInput: this.#seated && driving?.away === null, away: driving?.away ?? '',
      device: driving?.device ?? '',
      delay_ms: Number.isFinite(round_trip_ms) ? Math.round(round_trip_ms) : null,
      input_delay_ms: own?.input_delay_ms ?? null,
      trouble: trouble === null ? '' : [WORDS.en[trouble], more].filter(Boolean).join(' '),
    };
  }

  /** @returns time of the shown picture [s] */
  get #time_s(): number | null {
    const { view3d, world } = window.crgame;
    const t = view3d?.on ? view3d.stats?.t : world.shown?.t;
    return t === undefined || !Number.isFinite(t) ? null : Math.round(1000 * t) / 1000;
  }

  get #view(): StageView {
    const { view3d } = window.crgame;
    return view3d?.on ? view3d.viewpoint : 'map';
  }

  get #sound(): StageState['sound'] {
    const { sound } = window.crgame;
    return sound === undefined || !sound.wanted ? 'off' : !sound.allowed ? 'none'
      : sound.on ? 'on' : 'waits';
  }
}

/**
 * Make the page a stage.
 * @throws {Error} if the address is not one of a stage
 */
export function createStage(root: HTMLElement, store: Store, connection: Connection): Stage {
  const address = readStage(window.location.search);
  if (address === null) {
    throw new Error('the address names no seat');
  }
  return new Stage(root, store, connection, address);
}

/** The sender and receiver of messages to the framing page. */
class FrameLink {
  #store;
  #told = '';
  #heard = '';

  /** `store` whose `framedBy` has the origins; `ordered` called for each order of that page. */
  constructor(store: Store, ordered: (order: StageOrder) => void) {
    this.#store = store;
    window.addEventListener('message', ({ source, origin, data }) => {
      if (source === window.parent && window.parent !== window && origin !== ''
          && store.framedBy.includes(origin) && isOrder(data)) {
        this.#heard = origin;
        ordered(data);
      }
    });
  }

  /** Send the state if it has changed. */
  send(state: StageState) {
    const { framedBy } = this.#store;
    const text = JSON.stringify(state);
    if (window.parent !== window && framedBy.length > 0 && text !== this.#told) {
      this.#told = text;
      // The browser gives it only to a page of the named origin.
      for (const origin of this.#heard === '' ? framedBy : [this.#heard]) {
        window.parent.postMessage({ crgame: 1, kind: 'stage', state }, origin);
      }
    }
  }
}

function isOrder(data: unknown): data is StageOrder {
  if (typeof data !== 'object' || data === null) {
    return false;
  }
  const { crgame, kind, ready, profiles } = data as Record<string, unknown>;
  return crgame === 1 && (kind === 'focus' || (kind === 'ready' && typeof ready === 'boolean')
    || (kind === 'calibrations' && typeof profiles === 'object' && profiles !== null));
}
