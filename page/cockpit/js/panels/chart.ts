// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** One scrolling plot: a title with the newest values, and Plotly below. */

import { element, setAttribute, setText } from '../dom.js';
import { fixed } from './format.js';

import type { Plotly } from './plotly.js';
import type { Quantity, Trace } from './quantities.js';

const CONFIG = { displayModeBar: false, doubleClick: 'reset', showTips: false };
// A scrolling plot has no hover, which saves setting up handlers at each redrawing.
const SCROLLING = { ...CONFIG, staticPlot: true };
const HOVER_DIGITS = 3;

export interface ChartView {
  from: number; // [s]
  to: number; // [s]
  shown: number; // time of the newest value [s]
  cursor: number | null; // [s]
  colours: { grid: string; text: string; surface: string };
  rem: number; // [px]
  frozen: boolean;
}

/** A plot of one quantity over time. */
export class Chart {
  #plotly;
  #plot = element('div', { class: 'chart-plot' });
  #values = element('span', { class: 'chart-values' });
  #shown = new Map<string, HTMLElement>();
  #box: DOMRectReadOnly | null = null;
  #traces: Trace[] = [];
  quantity;
  root;

  constructor(library: Plotly, quantity: Quantity) {
    this.#plotly = library;
    this.quantity = quantity;
    const lines = quantity.lines.flatMap((line, i) => (line.name ? [element('span', {
      class: `line-name line-${'limit' in line ? 'limit' : i}`, text: line.name,
    })] : []));
    this.root = element('div', { class: 'chart', 'data-key': quantity.key },
      element('div', { class: 'chart-head' },
        element('h3', { text: quantity.title }),
        element('span', { class: 'dim', text: quantity.unit }), ...lines, this.#values),
      this.#plot);
    // Reading the size at each redrawing would force a layout of the page.
    new ResizeObserver(([entry]) => { this.#box = entry.contentRect; }).observe(this.#plot);
  }

  /** Return the element that Plotly draws in. */
  get plot() {
    return this.#plot;
  }

  /** Return the points drawn last, one row each: quantity, unit, line, time [s], value. */
  get rows(): (string | number)[][] {
    const { title, unit } = this.quantity;
    return this.#traces.flatMap(({ name, x, y }) => Array.from(x, (t, i) => (
      [title, unit, name, t, y[i] ?? NaN])).filter((row) => Number.isFinite(row[4])));
  }

  update(traces: Trace[], view: ChartView) {
    this.#traces = traces;
    this.#showValues(traces);
    const box = this.#box;
    if (box === null || box.width === 0) {
      return;
    }
    this.#plotly.react(this.#plot, traces.map((trace) => ({
      type: 'scatter', mode: 'lines', x: trace.x, y: trace.y, name: trace.name,
      line: { color: trace.color, width: 1.5 + 0.03 * view.rem, dash: trace.dash },
      hovertemplate: `%{y:.${HOVER_DIGITS}f}`, connectgaps: false,
    })), this.#layout(view, box), view.frozen ? CONFIG : SCROLLING);
  }

  #layout(view: ChartView, box: DOMRectReadOnly) {
    const { colours, rem } = view;
    const axis = {
      gridcolor: colours.grid, linecolor: colours.grid, zeroline: false, fixedrange: !view.frozen,
      tickfont: { size: Math.max(12, 0.72 * rem), color: colours.text }, ticks: '',
    };
    return {
      width: box.width, height: box.height, showlegend: false,
      margin: { l: 2.9 * rem, r: 0.5 * rem, t: 0.4 * rem, b: 1.4 * rem },
      paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)',
      font: { family: 'system-ui, sans-serif', color: colours.text,
        size: Math.max(12, 0.75 * rem) },
      hovermode: view.frozen ? 'x unified' : false, dragmode: view.frozen ? 'zoom' : false,
      hoverlabel: { bgcolor: colours.surface, bordercolor: colours.grid },
      xaxis: { ...axis, range: [view.from, view.to], nticks: 6, hoverformat: '.2f' },
      yaxis: {
        ...axis, nticks: 5, zeroline: !this.quantity.range, zerolinecolor: colours.grid,
        ...(this.quantity.range ? { range: this.quantity.range } : { rangemode: 'normal' }),
      },
      shapes: view.cursor === null ? [] : [{
        type: 'line', x0: view.cursor, x1: view.cursor, yref: 'paper', y0: 0, y1: 1,
        line: { color: colours.text, width: 1 },
      }],
    };
  }

  #showValues(traces: Trace[]) {
    if (this.#shown.size !== traces.length
        || traces.some((trace) => this.#shown.get(trace.name)?.dataset.color !== trace.color)) {
      this.#shown = new Map(traces.map((trace) => {
        const node = element('span', {
          class: 'chart-value', title: trace.name, 'data-color': trace.color,
          'data-dash': trace.dash,
        });
        node.style.setProperty('--line', trace.color);
        return [trace.name, node];
      }));
      this.#values.replaceChildren(...this.#shown.values());
    }
    for (const trace of traces) {
      const node = this.#shown.get(trace.name);
      if (node !== undefined) {
        setText(node, fixed(trace.now, this.quantity.digits));
        setAttribute(node, 'hidden', !Number.isFinite(trace.now));
      }
    }
  }
}
