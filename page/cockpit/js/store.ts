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
import { ServerClock } from './server_clock.js';

import type {
  CriticalityFrame, ObjectsFrame, PerceptionFrame, PlanFrame, PredictionFrame, StateFrame,
} from './frames.js';
import type { History } from './history.js';
import type {
  Alarm, AlarmsMessage, DeviceDelay, EventsMessage, Exposure, FilesMessage, FiredEvent,
  HelloMessage, Measure, NoticeMessage, PeopleMessage, Present, Rights, RunState, Scene,
  SceneMessage, SceneVehicle, Seat, SeatsMessage, SignalsMessage, Status, StatusMessage,
  StoreMessage, YouMessage,
} from './messages.js';
import type { TasksMessage } from './tasks/task_messages.js';

// Samples for a replay of the last 10 s: states at 100 Hz, and scenario steps at up to 25 Hz.
const RAW_SAMPLES = 1020;
const RAW_STEPS = 260;
const HISTORY_SPACING_S = 0.05;
const HISTORY_S = 120;
// How long an object whose next step is late is extrapolated beyond it [s].
const LATE_S = 0.1;

// The shown state at a time: the rows of all vehicles and objects.
export interface Shown {
  t: number;
  n: number;
  k: number;
  epoch: number;
  vehicles: Float64Array;
  objects: Float64Array;
}

export type HistorySource = (index: number, seconds: number) => History;

/** The content that a listener gets, by event. */
export interface StoreEvents {
  hello: HelloMessage;
  scene: SceneMessage;
  seats: SeatsMessage;
  signals: SignalsMessage;
  events: EventsMessage;
  tasks: TasksMessage;
  status: StatusMessage;
  run: RunState; // when it is another than in the status before
  alarms: AlarmsMessage;
  files: FilesMessage;
  notice: NoticeMessage;
  you: YouMessage;
  people: PeopleMessage;
  connection: boolean; // whether there is one
  state: StateFrame;
  objects: ObjectsFrame;
  plan: PlanFrame;
  prediction: PredictionFrame;
  perception: PerceptionFrame;
  criticality: CriticalityFrame;
  epoch: number;
}

/** The page's data; see `on` for the events by which parts learn of changes. */
export class Store {
  // Latest documents of the server; null or empty before the first.
  scene: Scene | null = null;
  seats: Record<string, Seat> = {};
  signals: Omit<SignalsMessage, 'type'> = { k: 0, states: {}, objects: {} };
  fired: FiredEvent[] = [];
  tasks: Omit<TasksMessage, 'type'> = { running: [], open: [] };
  status: Status | null = null;
  alarms: Alarm[] = [];
  me = { id: '', name: '' };
  people: Present[] = [];
  devices: DeviceDelay[] = [];
  rights: Rights = { role: '', directs: false, drives: false, seat: '', may_direct: false,
    may_drive: false };
  mode: HelloMessage['mode'] | null = null;
  /** Origins of the only pages that may frame this one. */
  framedBy: string[] = [];
  connected = false;
  round_trip_ms = NaN;
  /** The clock of the server's machine. */
  serverClock = new ServerClock();

  /** Counts resets; -1 before the first frame. */
  epoch = -1;
  plans = new Map<number, PlanFrame>(); // the newest plan by vehicle's index
  /** The newest predictions by index of the asking AV. */
  predictions = new Map<number, PredictionFrame>();
  /** The perception of AVs, and the map of permanent obstacles. */
  perceived = new Perceived();
  measures: Measure[] = []; // of criticality, as the server has greeted with
  exposures: Exposure[] = []; // likewise
  /** The criticality of the vehicles; of a replay, over the whole run. */
  criticality = new CriticalityLog(() => this.measures, HISTORY_S);
  // Received raw samples, a few seconds: states and scenario steps.
  samples = new SampleRing<StateFrame>(RAW_SAMPLES);
  steps = new SampleRing<ObjectsFrame>(RAW_STEPS);
  clock = new DisplayClock();

  // True from each hello to the first state: it may be another simulation with new epochs.
  #fresh = true;
  // Each set holds the listeners of one event; StoreEvents describes their content.
  #listeners = new Map<string, Set<(content: never) => void>>();
  #history = new SampleRing<StateFrame>(HISTORY_S / HISTORY_SPACING_S, HISTORY_SPACING_S);
  #shown: Shown = {
    t: 0, n: 0, k: 0, epoch: -1, vehicles: new Float64Array(0), objects: new Float64Array(0),
  };
  #shownFor_ms = NaN;
  #timeSource: ((now_ms: number) => number) | null = null;
  #historySource: HistorySource | null = null;

  /**
   * Listen to one or several events.
   * @param listener called after the store has stored the content
   * @returns ends it
   */
  on<Name extends keyof StoreEvents>(names: Name | Name[],
    listener: (content: StoreEvents[Name]) => void): () => void {
    const sets = [names].flat().map((name) => {
      const listeners = this.#listeners.get(name) ?? new Set();
      this.#listeners.set(name, listeners.add(listener));
      return listeners;
    });
    return () => sets.forEach((listeners) => listeners.delete(listener));
  }

  /** Store a document or an event of the server. */
  receive(message: StoreMessage) {
    const before = this.status?.run;
    switch (message.type) {
      case 'hello':
        this.me = { id: message.client, name: message.name };
        this.mode = message.mode;
        this.framedBy = (message.framed_by ?? '').split(' ').filter(Boolean);
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
    if (message.type === 'status' && message.run !== before) {
      this.#emit('run', message.run);
    }
  }

  /** Store a binary frame; one of an earlier epoch is dropped; `now_ms`: when it arrived. */
  receiveFrame(buffer: ArrayBuffer, now_ms: number) {
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

  /** Remove all samples, for a reset or a jump of a replay; `epoch` of the frames to come. */
  restart(epoch: number) {
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

  /** @param connected whether the server can be reached */
  setConnected(connected: boolean) {
    this.connected = connected;
    this.clock.reset();
    this.#emit('connection', connected);
  }

  /**
   * Show the times of a function instead of those of the live clock.
   * @param source wall time [ms] -> simulation time [s]
   */
  useTimeSource(source: ((now_ms: number) => number) | null) {
    this.#timeSource = source;
    this.#shownFor_ms = NaN;
  }

  /**
   * Get the past of vehicles from a function instead of the received samples.
   * @param source as `history`
   */
  useHistorySource(source: HistorySource | null) {
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
   * @param now_ms the frame's time, as requestAnimationFrame gives it
   * @returns the same object each time, refilled; null before any sample
   */
  displayed(now_ms: number): Shown | null {
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
   * @param index of the vehicle in the scene
   * @param seconds how far back, at most 120 s
   */
  history(index: number, seconds: number): History {
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

  /** Return whether the person at this page drives a vehicle. */
  holds(id: string): boolean {
    return this.me.id !== '' && this.seats[id]?.holder === this.me.id;
  }

  /** Return the ids of the vehicles that the person at this page drives: one, save in between. */
  get own(): string[] {
    return Object.keys(this.seats).filter((id) => this.holds(id));
  }

  /** Return a vehicle of the scene, undefined when there is none. */
  vehicle(id: string | null | undefined): SceneVehicle | undefined {
    return this.scene?.vehicles.find((vehicle) => vehicle.id === id);
  }

  /** Return a vehicle's index in the scene and in STATE, -1 when there is none. */
  vehicleIndex(id: string): number {
    return this.scene === null ? -1 : this.scene.vehicles.findIndex((v) => v.id === id);
  }

  #receiveState(frame: StateFrame, now_ms: number) {
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

  #fillVehicles(shown: Shown) {
    const index = Math.max(this.samples.indexAt(shown.t), 0);
    // There is a sample: nothing is displayed before the first.
    const before = this.samples.at(index) as StateFrame;
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

  #fillObjects(shown: Shown) {
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

  #emit(name: keyof StoreEvents, content: StoreEvents[keyof StoreEvents]) {
    for (const listener of this.#listeners.get(name) ?? []) {
      listener(content as never);
    }
  }
}
