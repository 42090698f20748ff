// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The page's data: the server's documents, and the samples of the running epoch. */

import { CriticalityLog } from './criticality.js';
import { DisplayClock } from './display_clock.js';
import { decodeFrame, KIND } from './frames.js';
import { addToHistory, emptyHistory } from './history.js';
import { extrapolateVehicles, interpolateVehicles, moveObjects } from './interpolation.js';
import { Perceived } from './perceived.js';
import { SampleRing } from './samples.js';

/** @import { ObjectsFrame, PerceptionFrame, PlanFrame, PredictionFrame } from './frames.js' */
/** @import { CriticalityFrame, StateFrame } from './frames.js' */
/** @import { History } from './history.js' */
/** @import { Alarm, AlarmsMessage, EventsMessage, FilesMessage } from './messages.js' */
/** @import { Exposure, FiredEvent, HelloMessage, Measure, NoticeMessage } from './messages.js' */
/** @import { Scene, SceneMessage, Seat, SeatsMessage, SignalsMessage } from './messages.js' */
/** @import { DeviceDelay, PeopleMessage, Present, Rights } from './people_messages.js' */
/** @import { YouMessage } from './people_messages.js' */
/** @import { Status, StatusMessage, StoreMessage } from './messages.js' */
/** @import { TasksMessage } from './tasks/task_messages.js' */

// Samples for a replay of the last 10 s: states at 100 Hz, and scenario steps at up to 25 Hz.
const RAW_SAMPLES = 1020;
const RAW_STEPS = 260;
const HISTORY_SPACING_S = 0.05;
const HISTORY_S = 120;
// How long an object whose next step is late is extrapolated beyond it [s].
const LATE_S = 0.1;

/**
 * The shown state at a time: the rows of all vehicles and objects.
 *
 * @typedef {{t: number, n: number, k: number, epoch: number, vehicles: Float64Array,
 *   objects: Float64Array}} Shown
 * @typedef {(index: number, seconds: number) => History} HistorySource
 */

/**
 * The content that a listener gets, by event.
 *
 * @typedef {object} StoreEvents
 * @property {HelloMessage} hello
 * @property {SceneMessage} scene
 * @property {SeatsMessage} seats
 * @property {SignalsMessage} signals
 * @property {EventsMessage} events
 * @property {TasksMessage} tasks
 * @property {StatusMessage} status
 * @property {AlarmsMessage} alarms
 * @property {FilesMessage} files
 * @property {NoticeMessage} notice
 * @property {YouMessage} you
 * @property {PeopleMessage} people
 * @property {boolean} connection whether there is one
 * @property {StateFrame} state
 * @property {ObjectsFrame} objects
 * @property {PlanFrame} plan
 * @property {PredictionFrame} prediction
 * @property {PerceptionFrame} perception
 * @property {CriticalityFrame} criticality
 * @property {number} epoch
 */

/** The page's data; see `on` for the events by which parts learn of changes. */
export class Store {
  // Latest documents of the server; null or empty before the first.
  /** @type {Scene|null} */
  scene = null;
  /** @type {Record<string, Seat>} */
  seats = {};
  /** @type {Omit<SignalsMessage, 'type'>} */
  signals = { k: 0, states: {}, objects: {} };
  /** @type {FiredEvent[]} */
  fired = [];
  /** @type {Omit<TasksMessage, 'type'>} */
  tasks = { running: [], open: [] };
  /** @type {Status|null} */
  status = null;
  /** @type {Alarm[]} */
  alarms = [];
  me = { id: '', name: '' };
  /** @type {Present[]} */
  people = [];
  /** @type {DeviceDelay[]} */
  devices = [];
  /** @type {Rights} */
  rights = { role: '', directs: false, drives: false, seat: '', may_direct: false,
    may_drive: false };
  /** @type {HelloMessage['mode']|null} */
  mode = null;
  version = '';
  /** Origin of the one page that may frame this one; empty for none. */
  framedBy = '';
  connected = false;
  round_trip_ms = NaN;

  /** Counts resets; -1 before the first frame. */
  epoch = -1;
  /** @type {Map<number, PlanFrame>} the newest plan by vehicle's index */
  plans = new Map();
  /** @type {Map<number, PredictionFrame>} the newest predictions by index of the asking AV */
  predictions = new Map();
  /** The perception of AVs, and the map of permanent obstacles. */
  perceived = new Perceived();
  /** @type {Measure[]} of criticality, as the server has greeted with */
  measures = [];
  /** @type {Exposure[]} likewise */
  exposures = [];
  /** The criticality of the vehicles; of a replay, over the whole run. */
  criticality = new CriticalityLog(() => this.measures, HISTORY_S);
  // Received raw samples, a few seconds: states and scenario steps.
  /** @type {SampleRing<StateFrame>} */
  samples = new SampleRing(RAW_SAMPLES);
  /** @type {SampleRing<ObjectsFrame>} */
  steps = new SampleRing(RAW_STEPS);
  clock = new DisplayClock();

  // True from each hello to the first state: it may be another simulation with new epochs.
  #fresh = true;
  // Each set holds the listeners of one event; StoreEvents describes their content.
  /** @type {Map<string, Set<(content: any) => void>>} */
  #listeners = new Map();
  /** @type {SampleRing<StateFrame>} */
  #history = new SampleRing(HISTORY_S / HISTORY_SPACING_S, HISTORY_SPACING_S);
  /** @type {Shown} */
  #shown = {
    t: 0, n: 0, k: 0, epoch: -1, vehicles: new Float64Array(0), objects: new Float64Array(0),
  };
  #shownFor_ms = NaN;
  /** @type {((now_ms: number) => number)|null} */
  #timeSource = null;
  /** @type {HistorySource|null} */
  #historySource = null;

  /**
   * Listen to an event.
   *
   * @template {keyof StoreEvents} Name
   * @param {Name} name of the event
   * @param {(content: StoreEvents[Name]) => void} listener called after the store has stored the
   *   content
   * @returns {() => void} ends it
   */
  on(name, listener) {
    const listeners = this.#listeners.get(name) ?? new Set();
    this.#listeners.set(name, listeners.add(listener));
    return () => listeners.delete(listener);
  }

  /**
   * Store a document or an event of the server.
   *
   * @param {StoreMessage} message with its `type`
   */
  receive(message) {
    switch (message.type) {
      case 'hello':
        this.me = { id: message.client, name: message.name };
        this.mode = message.mode;
        this.version = message.version;
        this.framedBy = message.framed_by ?? '';
        this.measures = message.measures ?? [];
        this.exposures = message.exposures ?? [];
        this.rights = message.rights ?? this.rights;
        this.#fresh = true;
        break;
      case 'scene': {
        // A recording that is played again begins the same epoch again.
        const again = message.time?.epoch === this.scene?.time?.epoch
          && (message.again ?? 0) !== (this.scene?.again ?? 0);
        this.scene = message;
        this.perceived.occupancy = null;
        if ((message.time?.epoch ?? -1) > this.epoch || again
            || (this.#fresh && message.time?.epoch < this.epoch)) {
          this.restart(message.time.epoch);
        }
        break;
      }
      case 'you': this.rights = message.rights; break;
      case 'people': this.people = message.people; this.devices = message.devices; break;
      case 'seats': this.seats = message.seats; break;
      case 'signals': this.signals = message; break;
      case 'events': this.fired = message.fired; break;
      case 'tasks': this.tasks = message; break;
      case 'alarms': this.alarms = message.active; break;
      case 'status':
        this.status = message;
        this.clock.factor = message.real_time_factor ?? 1;
        break;
      default:
    }
    this.#emit(message.type, message);
  }

  /**
   * Store a binary frame; one of an earlier epoch is dropped.
   *
   * @param {ArrayBuffer} buffer the frame
   * @param {number} now_ms when it arrived
   */
  receiveFrame(buffer, now_ms) {
    const frame = decodeFrame(buffer);
    if (frame === null || (frame.epoch < this.epoch && !this.#fresh)) {
      return;
    }
    const wentBack = this.#fresh && frame.kind === KIND.STATE && frame.n < (this.latest?.n ?? NaN);
    if (frame.epoch !== this.epoch || wentBack) {
      this.restart(frame.epoch);
    }
    this.#fresh &&= frame.kind !== KIND.STATE;
    this.#shownFor_ms = NaN;
    switch (frame.kind) {
      case KIND.STATE: this.#receiveState(frame, now_ms); break;
      case KIND.OBJECTS: this.steps.push(frame); this.#emit('objects', frame); break;
      case KIND.PLAN: this.plans.set(frame.index, frame); this.#emit('plan', frame); break;
      case KIND.PREDICTION:
        this.predictions.set(frame.index, frame);
        this.#emit('prediction', frame);
        break;
      case KIND.CRITICALITY:
        this.criticality.add(frame);
        this.#emit('criticality', frame);
        break;
      default:
        this.perceived.add(frame);
        this.#emit('perception', frame);
    }
  }

  /**
   * Remove all samples, for a reset or a jump of a replay.
   *
   * @param {number} epoch of the frames to come
   */
  restart(epoch) {
    this.epoch = epoch;
    this.samples.clear();
    this.steps.clear();
    this.#history.clear();
    this.plans.clear();
    this.predictions.clear();
    this.perceived.clear();
    if (this.mode !== 'replay') {
      this.criticality.clear();
    }
    this.clock.reset();
    this.#shownFor_ms = NaN;
    this.#emit('epoch', epoch);
  }

  /** @param {boolean} connected whether the server can be reached */
  setConnected(connected) {
    this.connected = connected;
    this.clock.reset();
    this.#emit('connection', connected);
  }

  /**
   * Show the times of a function instead of those of the live clock.
   *
   * @param {((now_ms: number) => number)|null} source wall time [ms] -> simulation time [s]
   */
  useTimeSource(source) {
    this.#timeSource = source;
    this.#shownFor_ms = NaN;
  }

  /**
   * Get the past of vehicles from a function instead of the received samples.
   *
   * @param {HistorySource|null} source as `history`
   */
  useHistorySource(source) {
    this.#historySource = source;
  }

  /** Return the newest state sample, undefined before the first. */
  get latest() {
    return this.samples.newest;
  }

  /**
   * Return the state to show in an animation frame.
   *
   * Vehicles are interpolated linearly in t between the samples around t, or extrapolated from the
   * newest if it is late; objects are at pose + velocity * (t - t of their step).
   *
   * @param {number} now_ms the frame's time, as requestAnimationFrame gives it
   * @returns {Shown|null} the same object each time, refilled; null before any sample
   */
  displayed(now_ms) {
    const newest = this.samples.newest;
    if (newest === undefined) {
      return null;
    }
    if (now_ms === this.#shownFor_ms) {
      return this.#shown;
    }
    this.#shownFor_ms = now_ms;
    const shown = this.#shown;
    const runs = this.status === null || this.status.run === 'running';
    shown.t = this.#timeSource === null ? this.clock.time(now_ms, newest.t, runs && this.connected)
      : this.#timeSource(now_ms);
    shown.epoch = this.epoch;
    this.#fillVehicles(shown);
    this.#fillObjects(shown);
    return shown;
  }

  /**
   * Return a vehicle's past for plots.
   *
   * @param {number} index of the vehicle in the scene
   * @param {number} seconds how far back, at most 120 s
   * @returns {History}
   */
  history(index, seconds) {
    if (this.#historySource !== null) {
      return this.#historySource(index, seconds);
    }
    const newest = this.#history.newest;
    const past = emptyHistory();
    const first = newest === undefined ? 0 : this.#history.indexAt(newest.t - seconds) + 1;
    for (const sample of this.#history.toArray().slice(first)) {
      addToHistory(past, sample, index);
    }
    return past;
  }

  /**
   * @param {string} id of a vehicle
   * @returns {number} its index in the scene and in STATE, -1 when there is none
   */
  vehicleIndex(id) {
    return this.scene === null ? -1 : this.scene.vehicles.findIndex((v) => v.id === id);
  }

  /**
   * @param {StateFrame} frame
   * @param {number} now_ms
   */
  #receiveState(frame, now_ms) {
    if ((this.samples.newest?.vehicles.length ?? frame.vehicles.length)
        !== frame.vehicles.length) {
      this.samples.clear();
      this.#history.clear();
    }
    const isNew = frame.n > (this.samples.newest?.n ?? -1);
    if (this.samples.push(frame) && isNew) {
      this.clock.arrived(frame.t, now_ms);
      this.#history.push(frame);
    }
    this.#emit('state', frame);
  }

  /** @param {Shown} shown */
  #fillVehicles(shown) {
    const index = Math.max(this.samples.indexAt(shown.t), 0);
    // There is a sample: nothing is displayed before the first.
    const before = /** @type {StateFrame} */ (this.samples.at(index));
    const after = this.samples.at(index + 1);
    if (shown.vehicles.length !== before.vehicles.length) {
      shown.vehicles = new Float64Array(before.vehicles.length);
    }
    shown.n = before.n;
    shown.k = before.k;
    if (after !== undefined) {
      const share = (shown.t - before.t) / (after.t - before.t);
      interpolateVehicles(shown.vehicles, before.vehicles, after.vehicles, Math.max(share, 0));
    } else {
      extrapolateVehicles(shown.vehicles, before.vehicles, shown.t - before.t);
    }
  }

  /** @param {Shown} shown */
  #fillObjects(shown) {
    const step = this.steps.at(Math.max(this.steps.indexAt(shown.t), 0));
    const size = step?.objects.length ?? 0;
    if (shown.objects.length !== size) {
      shown.objects = new Float64Array(size);
    }
    if (step !== undefined) {
      const most = (this.scene?.time?.dt_c_s ?? 0.1) + LATE_S;
      moveObjects(shown.objects, step.objects,
        Math.min(Math.max(shown.t - step.t, 0), most));
    }
  }

  /**
   * @param {keyof StoreEvents} name
   * @param {StoreEvents[keyof StoreEvents]} content
   */
  #emit(name, content) {
    for (const listener of this.#listeners.get(name) ?? []) {
      listener(content);
    }
  }
}
