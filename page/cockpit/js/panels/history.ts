// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A panel of scrolling plots (FastSim's history of the host vehicle). */

import { limitsOf } from '../criticality.js';
import { element, inEveryFrame, setAttribute, setText } from '../dom.js';
import { onThemeChange, themeColor } from '../world/palette.js';
import { Chart } from './chart.js';
import { errorText } from './format.js';
import { recall, remember } from './memory.js';
import { loadPlotly } from './plotly.js';
import { QUANTITIES, traces } from './quantities.js';
import { HealthLog } from './series.js';

import type { SceneVehicle } from '../messages.js';
import type { Store } from '../store.js';
import type { ChartView } from './chart.js';
import type { Plotly } from './plotly.js';
import type { PlotData, Quantity } from './quantities.js';

const WINDOWS_S = [10, 30, 120];
const KEPT_S = 120;
// Interval at which each visible plot is redrawn [ms]. Only one is redrawn in an animation
// frame, because drawing all at once would take the time of several frames.
const PERIOD_MS = 400;
// The share of a replay's window that lies after the shown time.
const AHEAD = 0.35;
// Colours by role in the order of the vehicles; the first two are those of the map.
const COLOURS: Record<SceneVehicle['role'], string[]> = {
  human: ['human', 'series-1', 'series-2'], autonomous: ['av', 'series-3', 'series-4'],
};
const THEME = [...COLOURS.human, ...COLOURS.autonomous, 'accent', 'border', 'text-dim', 'surface',
  'alarm'];

/** The panel's parts and choices. */
export class HistoryPanel {
  #root;
  #store;
  #quantities;
  #health = new HealthLog(KEPT_S);
  #charts = new Map<string, Chart>();
  #inView = new Set<Element>();
  #waiting: Chart[] = [];
  #pasts: PlotData['vehicles'] | null = null;
  #rem_px = 16;
  #selected = new Set<string>();
  #window_s = Number(recall('window')) || 30;
  #frozen: number | null = null;
  #due_ms = 0;
  #loading = false;
  #theme: Record<string, string> = {};
  #chosen = false;
  #chips = element('div', { class: 'chips', role: 'group', 'aria-label': 'Vehicles' });
  #windows = element('div', { class: 'segments', role: 'group', 'aria-label': 'Time window' });
  #freeze = element('button', {
    type: 'button', 'aria-pressed': 'false', text: 'Freeze', title: 'Stop the plots to look at '
      + 'them: point for values, drag to zoom, double-click to zoom out',
    on: { click: () => this.freeze(this.#frozen === null) },
  });
  #hint = element('p', { class: 'hint', text: 'Loading the plots …' });
  #body = element('div', { class: 'charts' });

  /** `root` in a panel, or the panel; `quantities` that are plotted. */
  constructor(root: HTMLElement, store: Store, quantities: Quantity[]) {
    this.#root = root;
    this.#store = store;
    this.#quantities = quantities;
    for (const seconds of WINDOWS_S) {
      this.#windows.append(element('button', {
        type: 'button', text: `${seconds} s`, 'data-seconds': seconds,
        on: { click: () => this.setWindow(seconds) },
      }));
    }
    root.append(element('div', { class: 'history-bar' }, this.#windows, this.#freeze),
      this.#chips, this.#hint, this.#body);
    this.setWindow(WINDOWS_S.includes(this.#window_s) ? this.#window_s : 30);
    store.on('scene', () => this.#newScene());
    store.on('seats', () => this.#selectOwn());
    store.on('epoch', () => this.#health.clear());
    store.on('status', (status) => this.#health.add(status));
    onThemeChange(() => this.#readTheme());
    this.#readTheme();
    if (store.scene !== null) {
      this.#newScene();
    }
    inEveryFrame((now_ms) => this.#frame(now_ms));
  }

  /** The vehicles that are plotted, in the scene's order. */
  get selected() {
    return (this.#store.scene?.vehicles ?? []).filter(({ id }) => this.#selected.has(id));
  }

  /** The plots that have been drawn. */
  get charts() {
    return [...this.#charts.values()].filter((chart) => chart.rows.length > 0);
  }

  /** Return the points of all plots, as `Chart.rows`. */
  get rows() {
    return this.charts.flatMap((chart) => chart.rows);
  }

  /** @param on whether the plots stand still for inspection */
  freeze(on: boolean) {
    this.#frozen = on ? this.#now() : null;
    setAttribute(this.#freeze, 'aria-pressed', String(on));
    setText(this.#freeze, on ? 'Go on' : 'Freeze');
    this.#redrawAll();
  }

  /** @param seconds how much time the plots show */
  setWindow(seconds: number) {
    this.#window_s = seconds;
    remember('window', String(seconds));
    for (const button of childrenOf(this.#windows)) {
      button.setAttribute('aria-pressed', String(Number(button.dataset.seconds) === seconds));
    }
    this.#redrawAll();
  }

  /** `id` of a vehicle; `on`: whether it is plotted. */
  select(id: string, on: boolean) {
    if (on) {
      this.#selected.add(id);
    } else {
      this.#selected.delete(id);
    }
    this.#showChips();
    this.#redrawAll();
  }

  #newScene() {
    const ids = new Set(this.#store.scene?.vehicles.map((vehicle) => vehicle.id));
    this.#selected = new Set([...this.#selected].filter((id) => ids.has(id)));
    this.#chosen = this.#chosen && this.#selected.size > 0;
    this.#selectOwn();
    this.#frozen = null;
    setAttribute(this.#freeze, 'aria-pressed', 'false');
    setText(this.#freeze, 'Freeze');
    this.#makeChips();
  }

  /** Select the vehicle that this page drives, or the first, until the user chooses. */
  #selectOwn() {
    const vehicles = this.#store.scene?.vehicles ?? [];
    const own = vehicles.find(({ id }) => this.#store.holds(id));
    if (!this.#chosen && vehicles.length > 0 && (own || this.#selected.size === 0)) {
      this.#selected = new Set([(own ?? vehicles[0]).id]);
      this.#showChips();
    }
  }

  #makeChips() {
    this.#chips.replaceChildren(...(this.#store.scene?.vehicles ?? []).map(({ id }) => element(
      'button', {
        type: 'button', class: 'chip', 'data-id': id, text: id,
        on: {
          click: () => {
            this.#chosen = true;
            this.select(id, !this.#selected.has(id));
          },
        },
      })));
    this.#showChips();
  }

  #showChips() {
    const colours = this.#lineColours();
    for (const chip of childrenOf(this.#chips)) {
      const { id = '' } = chip.dataset;
      setAttribute(chip, 'aria-pressed', String(this.#selected.has(id)));
      chip.style.setProperty('--line', colours.get(id) ?? null);
    }
  }

  /** Read the colours; each costs a style calculation, so this is done only at a change. */
  #readTheme() {
    this.#theme = Object.fromEntries(THEME.map((name) => [name, themeColor(name)]));
    this.#showChips();
    this.#redrawAll();
  }

  #lineColours() {
    const seen = { human: 0, autonomous: 0 };
    const colourOf = ({ id, role }: SceneVehicle): [string, string] => {
      const names = COLOURS[role] ?? COLOURS.human;
      const name = names[seen[role] % names.length];
      seen[role] += 1;
      return [id, this.#theme[name]];
    };
    return new Map((this.#store.scene?.vehicles ?? []).map(colourOf));
  }

  #now() {
    return this.#store.mode === 'replay'
      ? this.#store.displayed(performance.now())?.t ?? 0 : this.#store.latest?.t ?? 0;
  }

  #redrawAll() {
    this.#pasts = null;
    this.#waiting = [...this.#charts.values()].filter((chart) => this.#inView.has(chart.root));
  }

  #frame(now_ms: number) {
    if (this.#root.closest('[hidden]') || document.hidden) {
      return;
    }
    if (this.#charts.size === 0) {
      this.#load();
      return;
    }
    if (this.#waiting.length === 0 && this.#frozen === null && now_ms >= this.#due_ms) {
      this.#due_ms = now_ms + PERIOD_MS;
      this.#redrawAll();
    }
    if (this.#waiting.length > 0 && this.#pasts === null) {
      this.#pasts = this.#gather();
      return;
    }
    const chart = this.#waiting.shift();
    if (chart !== undefined) {
      this.#draw(chart, this.#pasts ?? []);
    }
  }

  async #load() {
    if (this.#loading) {
      return;
    }
    this.#loading = true;
    try {
      const library = await loadPlotly();
      this.#hint.hidden = true;
      this.#makeCharts(library);
      this.#loading = false;
    } catch (error) {
      setText(this.#hint, errorText(error));
      // The next opening of the panel tries again.
      const observer = new MutationObserver(() => {
        observer.disconnect();
        this.#loading = false;
      });
      observer.observe(panelOf(this.#root), { attributeFilter: ['hidden'] });
    }
  }

  #makeCharts(library: Plotly) {
    const observer = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        if (entry.isIntersecting) {
          this.#inView.add(entry.target);
          this.#waiting.push(...[...this.#charts.values()].filter(
            (chart) => chart.root === entry.target));
        } else {
          this.#inView.delete(entry.target);
        }
      }
    }, { root: panelOf(this.#root) });
    for (const quantity of this.#quantities) {
      const chart = new Chart(library, quantity);
      this.#charts.set(quantity.key, chart);
      this.#body.append(chart.root);
      observer.observe(chart.root);
    }
    new ResizeObserver(() => {
      this.#rem_px = parseFloat(getComputedStyle(document.documentElement).fontSize);
      this.#redrawAll();
    }).observe(this.#body);
  }

  #draw(chart: Chart, vehicles: PlotData['vehicles']) {
    const shown = this.#frozen ?? this.#now();
    const replay = this.#store.mode === 'replay';
    const to = Math.max(replay ? shown + AHEAD * this.#window_s : shown, this.#window_s);
    const view: ChartView = {
      shown, to, from: to - this.#window_s, cursor: replay ? shown : null,
      frozen: this.#frozen !== null,
      rem: this.#rem_px,
      colours: {
        grid: this.#theme.border, text: this.#theme['text-dim'], surface: this.#theme.surface,
      },
    };
    chart.update(traces(chart.quantity, {
      vehicles, health: this.#health, runColor: this.#theme.accent,
      limitColor: this.#theme.alarm, limits: limitsOf(this.#store.measures, this.#store.status),
      exposures: this.#store.exposures,
    }, view), view);
  }

  /** Return the data of all plots of one round. */
  #gather(): PlotData['vehicles'] {
    const colours = this.#lineColours();
    const vehicles = this.#store.scene?.vehicles ?? [];
    return vehicles.flatMap(({ id, role }, index) => (this.#selected.has(id) ? [{
      id, role, color: colours.get(id) ?? '', past: this.#store.history(index, KEPT_S),
      critical: (name) => this.#store.criticality.past(index, name),
    }] : []));
  }
}

/** @returns the element that is hidden and scrolled together with it */
function panelOf(root: HTMLElement): HTMLElement {
  return root.closest('.panel') ?? root;
}

function childrenOf(root: HTMLElement): HTMLElement[] {
  return [...root.children] as HTMLElement[];
}

export function createHistory(root: HTMLElement, store: Store): HistoryPanel {
  return new HistoryPanel(root, store, QUANTITIES);
}
