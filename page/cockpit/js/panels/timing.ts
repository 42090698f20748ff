// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The run's timing against the wall clock: live figures of the time-sync supervisor. */

import { element, setAttribute, setText } from '../dom.js';
import { count, fixed, oneLine, plural } from './format.js';

import type { Status, Timing } from '../messages.js';
import type { Store } from '../store.js';

// Lag in steps from which timesync_node calls a run late.
const LATE_STEPS = 10;

export type Format = (value: number) => string;
const ms = (digits: number): Format => (value) => `${fixed(value, digits)} ms`;
const percent = (digits: number): Format => (value) => `${fixed(100 * value, digits)} %`;
const ratio: Format = (value) => fixed(value, 3);

export type Named = [key: string, name: string, explanation: string];
export type Figure = [...Named, format: Format,
  isLate?: (value: number, step_ms: number) => boolean];
export type Rows = Map<string, { show: (text: string, late: boolean) => void }>;

export const TABLE_I: Figure[] = [
  ['final_error_ms', 'Lag now', 'E_f: simulated behind wall-clock time, resets added back',
    ms(2), (value, step) => value > LATE_STEPS * step],
  ['mean_step_error_ms', 'Mean step error', 'mean of |e_n| over all steps', ms(3),
    (value, step) => value > step],
  ['max_cumulative_error_ms', 'Largest lag', 'E_max over the run, resets added back', ms(2),
    (value, step) => value > LATE_STEPS * step],
  ['timeout_ratio', 'Cycles over budget', 'share of cycles that computed longer than a step',
    percent(2), (value) => value > 0.01],
  ['real_time_ratio_final', 'Real-time ratio', 'simulated over wall-clock time, whole run', ratio,
    (value) => value < 0.99],
  ['real_time_ratio_mean', 'Real-time ratio, mean',
    'mean of the ratio since the start of the run', ratio],
  ['real_time_ratio_min', 'Real-time ratio, slowest step', 'of a single step', ratio],
  ['time_efficiency', 'Time efficiency', 'simulated over wall-clock duration', percent(2),
    (value) => value < 0.99],
  ['precision_ratio', 'Precision ratio', 'P_r: lag now over the duration',
    (value) => (Number.isFinite(value) ? value.toExponential(1).replace('-', '−') : '–')],
];

const MORE: Figure[] = [
  ['rate_hz', 'Rate', 'steps per second', (value) => `${fixed(value, 1)} Hz`],
  ['worst_lag_ms', 'Worst lag', 'behind the schedule in force when a cycle began', ms(1),
    (value, step) => value > LATE_STEPS * step],
  ['late_steps', 'Late steps', 'steps of an error over 0.5 ms', count],
  ['catch_up_steps', 'Caught up', 'cycles that began more than a step late', count],
  ['step_error_p50_ms', 'Step error, median', 'of |e_n|', ms(3)],
  ['step_error_p99_ms', 'Step error, 99 %', '99th percentile of |e_n|', ms(3)],
  ['busy_p50_ms', 'Computing, median', 'busy time of a cycle', ms(2),
    (value, step) => value > step],
  ['busy_p99_ms', 'Computing, 99 %', 'busy time of a cycle', ms(2),
    (value, step) => value > step],
  ['resets', 'Drift resets', 'times the schedule was moved on', count, (value) => value > 0],
  ['dropped_ms', 'Time dropped', 'by which resets moved the schedule', ms(1),
    (value) => value > 0],
  ['frame_skip_orders', 'Frame skips', 'times frames were skipped to catch up', count],
  ['cycles', 'Cycles', 'seen in this run', count],
  ['duration_s', 'Duration', 'measured', (value) => `${fixed(value, 1)} s`],
];

export function createTiming(root: HTMLElement, store: Store) {
  const hint = element('p', { class: 'hint', text: 'Measured from the second step on.' });
  const run: Rows = new Map();
  const rows: Rows = new Map();
  const worst = element('p', { class: 'hint', 'data-key': 'worst_late_step' });
  const tables = element('div', {},
    element('h2', { text: 'Timekeeping' }), table(TABLE_I, rows, 'Table I'),
    element('h3', { text: 'What explains it' }), table(MORE, rows, 'What explains it'), worst);
  root.append(element('h2', { text: 'Run' }), table([
    ['factor', 'Speed of time', 'measured, and as asked for'],
    ['skipping', 'Frames', 'frames for people are skipped while the run is late'],
    ['clients', 'Open pages', 'connected to this cockpit'],
    ['delay', 'Answer time', 'of the server to this page'],
  ], run, 'Run'), tables, hint);

  const update = () => {
    const status = store.status;
    if (status === null || root.closest('[hidden]')) {
      return;
    }
    showRun(run, status, store);
    const step_ms = 1e3 * (store.scene?.time.dt_s ?? NaN);
    setAttribute(hint, 'hidden', Boolean(status.timing));
    setAttribute(tables, 'hidden', !status.timing);
    const { timing } = status;
    if (timing) {
      for (const [key, , , format, isLate] of [...TABLE_I, ...MORE]) {
        const value = valueOf(timing, key);
        rows.get(key)?.show(format(value), Boolean(isLate?.(value, step_ms)));
      }
      setText(worst, worstLateStep(timing));
    }
  };
  store.on('status', update);
  new MutationObserver(update).observe(root, { attributeFilter: ['hidden'] });
  update();
}

/**
 * @param timing figures by key, live or from `timing.json`
 * @param key of the figure
 * @returns NaN if there is none
 */
export function valueOf(timing: Timing, key: string): number {
  const nested = key.match(/^(real_time_ratio)_(\w+)$/);
  const group = nested && !(key in timing) ? timing[nested[1]] : undefined;
  const value = nested && group && typeof group === 'object' ? group[nested[2]] : timing[key];
  return typeof value === 'number' ? value : NaN;
}

/** @returns the worst late step and its causes, in words */
export function worstLateStep(timing: Timing): string {
  const told = timing.worst_late_step;
  if (typeof told !== 'string') {
    return 'This recording does not tell why steps were late: an earlier version made it.';
  }
  return told === '' ? 'No step was late.' : `Worst late step: ${oneLine(told)}.`;
}

function showRun(run: Rows, status: Status, store: Store) {
  const asked = status.real_time_factor;
  const measured = status.measured_factor;
  const slow = status.run === 'running' && measured !== null && measured < 0.95 * asked;
  run.get('factor')?.show(Number.isFinite(measured)
    ? `${fixed(measured, 2)} × of ${fixed(asked, 2)} ×` : `${fixed(asked, 2)} ×`, slow);
  const skipping = Boolean(status.frames_skipped);
  run.get('skipping')?.show(skipping ? 'skipped to catch up' : 'all shown', skipping);
  run.get('clients')?.show(plural(status.clients ?? 0, 'page'), false);
  run.get('delay')?.show(`${fixed(store.round_trip_ms, 0)} ms`, store.round_trip_ms > 200);
}

function table(entries: [...Named, ...unknown[]][], rows: Rows, caption: string) {
  return element('table', { class: 'figures' },
    element('caption', { class: 'unseen', text: caption }),
    element('tbody', {}, ...entries.map(([key, name, explanation]) => {
      const value = element('td', {});
      const row = element('tr', { 'data-key': key, title: explanation },
        element('th', { scope: 'row', text: name }), value);
      rows.set(key, {
        show(text, late) {
          setText(value, text);
          setAttribute(row, 'data-late', late);
        },
      });
      return row;
    })));
}
