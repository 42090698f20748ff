// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The tasks of the driver at this page: their view, and answers timed by the page's clock. */

import { attends } from '../attending.js';
import { labelsOf, languageOf, WORDS } from '../driver_words.js';
import { Answers, keyName } from './answers.js';
import { inPicture, Prompt, RunningTime } from './prompt.js';
import { TaskView } from './task_view.js';

import type { Connection } from '../connection.js';
import type { Store } from '../store.js';
import type { Answered, AnswerInputs } from './answers.js';
import type { GameTask, OpenPrompt, PageTimes } from './task_messages.js';

/** The tasks of a page; in `window.crgame.tasks`. */
export class Tasks {
  #store;
  #connection;
  #running = new RunningTime();
  #tone = new RequestTone();
  #view;
  #answers;
  /** The open prompts of this page, by task and number. */
  #prompts = new Map<string, Prompt>();
  #words = WORDS.en;
  #labels = labelsOf(window.location.search);
  #frameRequested = false;

  constructor(stage: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    this.#view = new TaskView(stage);
    this.#answers = new Answers(() => this.#inputs, (what) => this.#accepts(what),
      (what, at_ms) => this.#answer(what, at_ms));
    this.#answers.touch(this.#view.answerButton);
    this.#answers.touch(this.#view.light);
    this.#view.takeButton.addEventListener('click', () => this.#takeOver());
    store.on('scene', () => this.#begin());
    store.on('epoch', () => this.#forget());
    store.on(['tasks', 'seats', 'connection'], () => this.#update());
    store.on('status', () => {
      this.#running.note(this.#runs, performance.now());
      this.#requestFrame();
    });
    this.#begin();
  }

  get prompts(): Prompt[] {
    return [...this.#prompts.values()];
  }

  /** @returns what the driver sees of tasks now, the foremost first */
  get shown(): { task: string; node: HTMLElement }[] {
    const now_ms = performance.now();
    const { light, request, note } = this.#view;
    const parts = [[this.prompts.find((prompt) => prompt.lit(now_ms))?.task, light],
      [this.#request?.prompt.task, request], [this.#lasting[0], note]] as const;
    return parts.flatMap(([task, node]) => (task === undefined || node.hidden ? []
      : [{ task: task.name, node }]));
  }

  get #runs() {
    return this.#store.connected && this.#store.status?.run === 'running';
  }

  /** Return whether an answer is accepted: the run goes on, and a task of this driver asks. */
  #accepts(what: Answered) {
    return this.#runs && (what === 'light' ? this.#detecting !== undefined
      : this.#request?.free === true);
  }

  get #wanted() {
    return this.#accepts('light') || this.#accepts('request');
  }

  /** @returns the inputs for the tasks that this page's driver may get in this run */
  get #inputs(): AnswerInputs {
    const tasks = this.#store.scene?.tasks ?? [];
    const light = this.#mine.find(({ kind }) => kind === 'detection_response');
    const seat = light?.seat ?? this.#request?.prompt.task.seat;
    const request = tasks.find((task) => task.kind === 'take_over' && task.seat === seat);
    const input = (task: GameTask | undefined) => (task?.key ? { key: task.key,
      button: task.button } : undefined);
    return { light: input(light), request: input(request) };
  }

  /** @returns the tasks of the game for this page's driver */
  get #mine(): GameTask[] {
    return (this.#store.scene?.tasks ?? []).filter(({ seat }) => attends(this.#store, seat));
  }

  /** @returns this driver's active detection task */
  get #detecting(): GameTask | undefined {
    const { running } = this.#store.tasks;
    return this.#mine.find(({ name, kind }) => kind === 'detection_response'
      && running.includes(name));
  }

  /** Return the request to show here, and whether its seat is free. */
  get #request() {
    const prompt = this.prompts.find(({ task }) => task.kind === 'take_over');
    return prompt && { prompt, free: this.#mayTake(prompt.task.seat) };
  }

  /**
   * Return whether the person may take a seat. A request of an AV goes to every page that does not
   * drive.
   */
  #mayTake(seat: string) {
    const { own, seats, me, rights } = this.#store;
    return own.length === 0 && rights.drives && me.id !== '' && seats[seat] !== undefined
      && !seats[seat].holder && (rights.seat === '' || rights.seat === seat);
  }

  #begin() {
    const language = languageOf(window.location.search, this.#store.scene?.language);
    this.#words = WORDS[language];
    this.#view.speak(this.#words, language);
    this.#update();
  }

  #forget() {
    this.#prompts.clear();
    this.#running = new RunningTime();
    this.#running.note(this.#runs, performance.now());
    this.#update();
  }

  /** Add new prompts and remove closed ones. */
  #update() {
    const now_ms = performance.now();
    const mine = this.#mine;
    const tasks = this.#store.mode === 'live' ? this.#store.scene?.tasks ?? [] : [];
    const open = this.#store.connected ? this.#store.tasks.open : [];
    const kept = new Set<string>();
    for (const each of open) {
      const task = tasks.find(({ name }) => name === each.task);
      if (task && (mine.includes(task)
          || (task.kind === 'take_over' && this.#mayTake(task.seat)))) {
        const key = `${each.task}/${each.number}`;
        kept.add(key);
        if (!this.#prompts.has(key)) {
          this.#open(key, each, task, now_ms);
        }
      }
    }
    for (const key of this.#prompts.keys()) {
      if (!kept.has(key)) {
        this.#prompts.delete(key);
      }
    }
    this.#showWhatLasts();
    this.#requestFrame();
  }

  #open(key: string, open: OpenPrompt, task: GameTask, now_ms: number) {
    const prompt = new Prompt(open, task, this.#running, now_ms, this.#store.round_trip_ms);
    this.#prompts.set(key, prompt);
    const light = task.kind === 'detection_response';
    if (light && open.seen) {
      // It was shown before this page was reloaded, so an answer to it cannot be timed.
      prompt.answered = true;
      return;
    }
    inPicture(() => {
      // Until then, the previous picture is shown.
      prompt.draw(performance.now());
      this.#draw();
    }).then(({ drawn_ms, picture_ms }) => {
      prompt.draw(drawn_ms);
      prompt.picture_ms = picture_ms;
      prompt.shown = this.#store.serverClock.at(drawn_ms);
      this.#send(prompt, 'shown', prompt.times());
    });
    if (!light && !open.seen && this.#store.scene?.sound !== 'none') {
      this.#tone.play(window.crgame.sound?.volume ?? 1);
    }
  }

  /** @returns the secondary tasks of which this driver reads */
  get #lasting(): GameTask[] {
    const { running } = this.#store.tasks;
    return this.#store.connected ? this.#mine.filter(({ name, kind, show }) => show
      && kind === 'secondary_task' && running.includes(name)) : [];
  }

  #showWhatLasts() {
    this.#view.showNote(this.#lasting.map(({ name, label }) => `${this.#words.secondary}: `
      + `${this.#labels.get(name) ?? (label || name)}`).join(' · '));
    this.#view.answerButton.hidden = this.#detecting === undefined;
  }

  /** Update in every frame while there are prompts. */
  #requestFrame() {
    if (!this.#frameRequested) {
      this.#frameRequested = true;
      requestAnimationFrame(() => this.#frame());
    }
    if (this.#wanted) {
      this.#answers.watch();
    }
  }

  #frame() {
    this.#frameRequested = false;
    this.#draw();
    if (this.#prompts.size > 0 && this.#runs) {
      this.#requestFrame();
    }
  }

  /** Draw the current state. */
  #draw() {
    const now_ms = performance.now();
    this.#view.light.hidden = !this.prompts.some((prompt) => prompt.task.kind
      === 'detection_response' && prompt.lit(now_ms));
    const request = this.#request;
    this.#drawCorner(!this.#view.light.hidden || request !== undefined);
    if (request === undefined) {
      this.#tone.stop();
      this.#view.showRequest(null);
      return;
    }
    const { task } = request.prompt;
    this.#view.showRequest({
      label: this.#labels.get(task.name) ?? task.label, free: request.free,
      hint: request.free ? this.#words.takeOverHint.replace('{key}', keyName(task.key ?? ''))
        : this.#words.hold,
    });
  }

  /**
   * Draw the corner for a photodiode, if the address names one.
   * @param lit whether a stimulus is in the same picture
   */
  #drawCorner(lit: boolean) {
    const { corner } = this.#view;
    const where = window.crgame.stage?.address.corner ?? null;
    corner.hidden = where === null;
    if (where !== null) {
      corner.dataset.corner = where;
      corner.classList.toggle('lit', lit);
    }
  }

  /** @param at_ms time of the answer */
  #answer(what: Answered, at_ms: number) {
    if (what === 'request') {
      this.#takeOver();
      return;
    }
    const detecting = this.#detecting;
    const prompt = this.prompts.find((each) => each.task.kind === 'detection_response'
      && each.accepts(at_ms));
    if (prompt !== undefined) {
      const times = prompt.times(at_ms);
      prompt.answered = true;
      this.#send(prompt, 'answer', times);
      this.#requestFrame();
    } else if (detecting !== undefined) {
      this.#connection.send({ type: 'task', seat: detecting.seat, task: detecting.name, number: 0,
        what: 'answer' });
    }
  }

  async #takeOver() {
    const request = this.#request;
    if (request?.free) {
      await window.crgame.driving?.claim(request.prompt.task.seat);
    }
  }

  #send({ open }: Prompt, what: 'shown' | 'answer', times: PageTimes) {
    const known = Object.fromEntries(Object.entries(times)
      .filter(([, value]) => Number.isFinite(value))
      .map(([name, value]) => [name, Math.round(1e6 * value) / 1e6]));
    this.#connection.send({ type: 'task', seat: open.seat, task: open.task, number: open.number,
      what, ...known });
  }
}

// Two beeps an octave above the engine's loudest tones, audible to older drivers too [Hz, s].
const PITCHES = [880, 1320];
const BEEP_S = 0.12;
const APART_S = 0.18;
const PAIR_S = 0.7;
const PAIRS = 3;
const RISE_S = 0.008;
const LOUDEST = 0.4;

/** The tone of a request; browsers allow it after a first gesture on the page. */
class RequestTone {
  #context: AudioContext | null = null;
  #sounding: OscillatorNode[] = [];

  constructor() {
    const begin = () => {
      this.#context ??= new AudioContext({ latencyHint: 'interactive' });
      if (this.#sounding.length === 0) {
        this.#context.suspend();
      }
      window.removeEventListener('keydown', begin, true);
      window.removeEventListener('pointerdown', begin, true);
    };
    window.addEventListener('keydown', begin, true);
    window.addEventListener('pointerdown', begin, true);
  }

  /** @param volume 0 to 1 */
  play(volume: number) {
    this.stop();
    const context = this.#context;
    if (context === null || volume <= 0) {
      return;
    }
    context.resume();
    const start = context.currentTime + 0.01;
    for (let pair = 0; pair < PAIRS; pair += 1) {
      PITCHES.forEach((pitch, i) => {
        this.#beep(context, pitch, start + pair * PAIR_S + i * APART_S, volume * LOUDEST);
      });
    }
  }

  stop() {
    for (const each of this.#sounding) {
      each.stop();
    }
    this.#sounding = [];
  }

  /** `pitch` [Hz]; `at`: time of the context [s]. */
  #beep(context: AudioContext, pitch: number, at: number, gain: number) {
    const tone = new OscillatorNode(context, { type: 'triangle', frequency: pitch });
    const level = new GainNode(context, { gain: 0 });
    level.gain.setValueAtTime(0, at);
    level.gain.linearRampToValueAtTime(gain, at + RISE_S);
    level.gain.setValueAtTime(gain, at + BEEP_S - RISE_S);
    level.gain.linearRampToValueAtTime(0, at + BEEP_S);
    tone.connect(level).connect(context.destination);
    tone.start(at);
    tone.stop(at + BEEP_S);
    tone.addEventListener('ended', () => {
      this.#sounding = this.#sounding.filter((each) => each !== tone);
      if (this.#sounding.length === 0) {
        context.suspend();
      }
    });
    this.#sounding.push(tone);
  }
}
