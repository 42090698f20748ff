// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The time line at the foot of the page: slider, events, buttons and keys of a replay. */

import { element, setAttribute, setText, svg } from '../dom.js';
import { eventText, mark } from './marks.js';

import type { ReplayInfo, ReplayMark } from '../api_messages.js';
import type { Player } from './player.js';

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const PAGE_S = 5;
const ICONS: Record<string, string> = {
  play: 'M6 4L20 12 6 20Z', pause: 'M6 4H10V20H6ZM14 4H18V20H14Z',
  back: 'M17 4V20L7 12ZM4 4H7V20H4Z', on: 'M7 4V20L17 12ZM17 4H20V20H17Z',
  previous: 'M12 5V19L3 12ZM21 5V19L12 12Z', next: 'M12 5V19L21 12ZM3 5V19L12 12Z',
};

/** The controls of a player. */
export class Timeline {
  #root;
  #player;
  #slider = element('input', { type: 'range', id: 'timeline-slider', step: 1, min: 0, max: 1,
    value: 0, 'aria-label': 'Time of the recording' });
  #marks = element('div', { class: 'timeline-marks' });
  #play = button('play', 'Play', 'Space', () => this.#player.toggle());
  #time = element('output', { class: 'timeline-time', 'aria-live': 'off' });
  #epochs = element('select', { 'aria-label': 'Run' });
  #epochField = element('label', { class: 'timeline-field', hidden: true },
    element('span', { text: 'Run' }), this.#epochs);
  #speeds = element('select', { 'aria-label': 'Speed of the replay' },
    ...SPEEDS.map((speed) => element('option', { value: speed, text: `× ${speed}` })));
  #told = element('span', { class: 'timeline-event', role: 'status' });

  /** `root`: footer#timeline; hidden until there is a recording; `player` that is controlled. */
  constructor(root: HTMLElement, player: Player) {
    this.#root = root;
    this.#player = player;
    const steps = [
      button('previous', 'Previous event', '[', () => player.jump(-1)),
      button('back', 'Back by one scenario step', ',', () => player.step(-1)),
      this.#play,
      button('on', 'On by one scenario step', '.', () => player.step(1)),
      button('next', 'Next event', ']', () => player.jump(1)),
    ];
    setAttribute(root, 'aria-label', 'Time line of the recording');
    root.replaceChildren(
      element('div', { class: 'timeline-track' }, this.#marks, this.#slider),
      element('div', { class: 'timeline-row' },
        element('div', { class: 'timeline-buttons', role: 'toolbar', 'aria-label': 'Replay' },
          ...steps), this.#time, this.#told,
        element('label', { class: 'timeline-field' }, element('span', { text: 'Speed' }),
          this.#speeds), this.#epochField));
    this.#speeds.value = '1';
    this.#speeds.addEventListener('change', () => {
      player.speed = Number(this.#speeds.value);
      this.#speeds.blur();
    });
    this.#epochs.addEventListener('change', () => {
      player.open(Number(this.#epochs.value));
      this.#epochs.blur();
    });
    this.#slider.addEventListener('input', () => {
      player.seek(Number(this.#slider.value) * this.#info.dt_s);
    });
    this.#slider.addEventListener('keydown', (event) => this.#slide(event));
    window.addEventListener('keydown', (event) => this.#key(event));
  }

  /** Start showing a run; `info` of the run. */
  show(info: ReplayInfo) {
    this.#root.hidden = false;
    setAttribute(this.#slider, 'min', String(info.first_n));
    setAttribute(this.#slider, 'max', String(info.last_n));
    const length_s = Math.max(info.end_s - info.start_s, info.dt_s);
    this.#marks.replaceChildren(...info.events.map((event) => mark(
      event, (event.t - info.start_s) / length_s, () => {
        this.#player.seek(event.t);
        this.showEvent(event);
      })));
    this.#epochs.replaceChildren(...info.epochs.map((epoch, i) => element('option',
      { value: epoch, text: `${i + 1} of ${info.epochs.length}` })));
    this.#epochs.value = String(info.epoch);
    this.#epochField.hidden = info.epochs.length < 2;
    setText(this.#told, info.events.length === 0 ? 'No events in this run' : '');
  }

  /** Show the player's time and state. */
  update() {
    const { t, n, k, playing, loading } = this.#player;
    const info = this.#info;
    const place = String(n);
    if (this.#slider.value !== place) {
      this.#slider.value = place;
    }
    const length_s = Math.max(info.end_s - info.start_s, info.dt_s);
    this.#slider.style.setProperty('--done', `${100 * (t - info.start_s) / length_s}%`);
    setAttribute(this.#slider, 'aria-valuetext', `${t.toFixed(2)} seconds, step ${k}`);
    setText(this.#time, `${t.toFixed(2)} / ${info.end_s.toFixed(2)} s   k ${k}`);
    setAttribute(this.#root, 'data-loading', loading);
    if (this.#play.dataset.action !== (playing ? 'pause' : 'play')) {
      this.#play.dataset.action = playing ? 'pause' : 'play';
      setAttribute(this.#play, 'aria-label', playing ? 'Pause' : 'Play');
      setAttribute(this.#play, 'title', `${playing ? 'Pause' : 'Play'} (Space)`);
      this.#play.replaceChildren(picture(playing ? 'pause' : 'play'));
    }
  }

  /** Show the event that was jumped to; `event` of the run's info. */
  showEvent(event: ReplayMark) {
    setText(this.#told, eventText(event));
  }

  /** Return the run's description; only used while a run is shown. */
  get #info() {
    return this.#player.info as ReplayInfo;
  }

  /** Move by scenario steps when arrow keys are pressed on the slider. */
  #slide(event: KeyboardEvent) {
    const player = this.#player;
    const moves: Record<string, () => void> = {
      ArrowLeft: () => player.step(-1), ArrowDown: () => player.step(-1),
      ArrowRight: () => player.step(1), ArrowUp: () => player.step(1),
      PageDown: () => player.seek(player.t - PAGE_S), PageUp: () => player.seek(player.t + PAGE_S),
      Home: () => player.seek(this.#info.start_s), End: () => player.seek(this.#info.end_s),
    };
    if (Object.hasOwn(moves, event.key)) {
      event.preventDefault();
      event.stopPropagation();
      moves[event.key]();
    }
  }

  #key(event: KeyboardEvent) {
    const { target } = event;
    if (this.#root.hidden || event.ctrlKey || event.metaKey || event.altKey
        || document.querySelector('dialog[open]')
        || (target !== this.#slider && target instanceof HTMLElement
          && target.matches('input, textarea, select, [contenteditable]'))) {
      return;
    }
    const player = this.#player;
    const keys: Record<string, () => void> = {
      ',': () => player.step(-1), '.': () => player.step(1),
      ArrowLeft: () => player.step(-1), ArrowRight: () => player.step(1),
      '[': () => player.jump(-1), ']': () => player.jump(1), ' ': () => player.toggle(),
    };
    // The space bar presses a focused button, and arrows choose in a list of tabs.
    const own = target instanceof HTMLElement && (
      event.key === ' ' && target.matches('button, summary, a')
      || event.key.startsWith('Arrow') && target.matches('[role="tab"], [role="radio"]'));
    if (Object.hasOwn(keys, event.key) && !own) {
      event.preventDefault();
      keys[event.key]();
    }
  }
}

function button(name: string, label: string, key: string, pressed: () => void) {
  return element('button', { type: 'button', 'data-action': name, 'aria-label': label,
    'aria-keyshortcuts': key, title: `${label} (${key})`, on: { click: pressed } }, picture(name));
}

function picture(name: string) {
  return svg('svg', { viewBox: '0 0 24 24', 'aria-hidden': 'true' },
    svg('path', { d: ICONS[name] }));
}
