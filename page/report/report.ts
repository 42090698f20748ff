// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Draws the plots of a report with Plotly, and leads from times to frames and plots. */

/**
 * @typedef {object} Line
 * @property {string} name
 * @property {string} colour name of a custom property
 * @property {string} dash
 * @property {string} x 32-bit floats in base64
 * @property {string} y 64-bit floats in base64
 *
 * @typedef {object} Plot
 * @property {string} unit
 * @property {boolean} plane
 * @property {[number, number]|null} bounds
 * @property {{value: number, label: string}[]} limits
 * @property {{from: number, to: number, label: string, colour: string}[]} spans
 * @property {Line[]} lines
 *
 * @typedef {HTMLElement & {
 *   on?: (event: string, listener: (change: Record<string, unknown>) => void) => void,
 *   layout?: {xaxis?: {autorange?: boolean, range?: [number, number]}},
 * }} PlotNode
 */

(() => {
  const { Plotly } = /** @type {{Plotly: any}} */ (/** @type {unknown} */ (window));
  // Of a plot on paper, two of them beside each other [CSS px].
  const PAPER = { width: 336, height: 196 };
  const PAPER_PLANE = { width: 690, height: 340 };
  const CONFIG = { displaylogo: false, displayModeBar: false, responsive: false };

  /** @type {Record<string, Plot>} */
  const plots = JSON.parse(document.getElementById('plots')?.textContent ?? '{}');
  /** @type {Map<string, {x: Float32Array, y: Float64Array}[]>} */
  const decoded = new Map();
  /** @type {Map<PlotNode, {paper: boolean}>} */
  const drawn = new Map();
  /** The chosen time of each run [s]. @type {Map<string, number>} */
  const chosen = new Map();
  const nodes = /** @type {PlotNode[]} */ ([...document.querySelectorAll('.plot')]);
  let printing = false;

  /** @param {string} text base64 */
  function bytes(text) {
    return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  }

  /** @param {string} name of a colour */
  function colour(name) {
    return theme.getPropertyValue(`--${name}`).trim();
  }

  // light-dark() is only resolved where it is used: each colour is asked of an element.
  const probe = document.createElement('span');
  probe.hidden = true;
  document.body.append(probe);
  const theme = {
    /** @param {string} name */
    getPropertyValue(name) {
      probe.style.color = `var(${name})`;
      return getComputedStyle(probe).color;
    },
  };

  /** @param {PlotNode} node */
  function runOf(node) {
    return node.id.split('-', 1)[0];
  }

  /** @param {PlotNode} node */
  function values(node) {
    const known = decoded.get(node.id);
    if (known !== undefined) {
      return known;
    }
    const found = plots[node.id].lines.map((line) => ({
      x: new Float32Array(bytes(line.x)), y: new Float64Array(bytes(line.y)),
    }));
    decoded.set(node.id, found);
    return found;
  }

  /** @param {PlotNode} node */
  function traces(node) {
    const found = values(node);
    return plots[node.id].lines.map((line, i) => ({
      type: 'scatter', mode: 'lines', name: line.name, x: found[i].x, y: found[i].y,
      line: {
        color: colour(line.colour), dash: line.dash, width: line.name === 'others' ? 1 : 2,
      },
      connectgaps: false,
      hoverinfo: line.name === 'others' ? 'skip' : undefined,
      hovertemplate: plots[node.id].plane ? '%{x:.2f}, %{y:.2f} m' : '%{y:.3f}',
    }));
  }

  /** @param {PlotNode} node */
  function shapes(node) {
    const plot = plots[node.id];
    const time = chosen.get(runOf(node));
    const lines = plot.limits.map((limit) => ({
      type: 'line', xref: 'paper', x0: 0, x1: 1, y0: limit.value, y1: limit.value,
      line: { color: colour('critical'), width: 1.5, dash: 'dashdot' },
      label: {
        text: limit.label, textposition: 'end', yanchor: 'bottom',
        font: { color: colour('critical'), size: 11 },
      },
    }));
    const spans = plot.spans.map((span) => ({
      type: 'rect', yref: 'paper', y0: 0, y1: 1, x0: span.from, x1: span.to, layer: 'below',
      fillcolor: colour(span.colour), opacity: 0.18, line: { width: 0 },
      label: {
        text: span.label, textposition: 'top left',
        font: { color: colour('text'), size: 11 },
      },
    }));
    const cursor = time === undefined || plot.plane ? [] : [{
      type: 'line', yref: 'paper', y0: 0, y1: 1, x0: time, x1: time,
      line: { color: colour('text'), width: 1 },
    }];
    return [...spans, ...lines, ...cursor];
  }

  /**
   * @param {PlotNode} node
   * @param {boolean} paper
   */
  function layout(node, paper) {
    const plot = plots[node.id];
    const size = paper ? (plot.plane ? PAPER_PLANE : PAPER)
      : { width: node.clientWidth, height: node.clientHeight };
    const axis = {
      gridcolor: colour('border'), linecolor: colour('border'), zeroline: false, automargin: true,
    };
    return {
      ...size, shapes: shapes(node),
      margin: { l: 48, r: 12, t: 8, b: 40 },
      paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)',
      font: {
        family: 'system-ui, Segoe UI, Roboto, DejaVu Sans, sans-serif', size: paper ? 10 : 12,
        color: colour('text'),
      },
      hovermode: plot.plane ? 'closest' : 'x unified',
      hoverlabel: { bgcolor: colour('raised'), bordercolor: colour('border') },
      showlegend: plot.lines.length > 1,
      legend: { orientation: 'h', x: 0, y: 1, yanchor: 'bottom', font: { size: 11 } },
      dragmode: 'zoom',
      xaxis: {
        ...axis, title: { text: plot.plane ? 'east [m]' : 'time [s]', standoff: 4 },
        hoverformat: '.2f', ticksuffix: '',
      },
      yaxis: {
        ...axis, nticks: 6,
        title: plot.plane ? { text: 'north [m]', standoff: 4 } : undefined,
        ...(plot.plane ? { scaleanchor: 'x' } : {}),
        ...(plot.bounds === null ? {} : { range: plot.bounds, autorange: false }),
      },
    };
  }

  /** @param {PlotNode} node */
  function draw(node) {
    const first = !drawn.has(node);
    drawn.set(node, { paper: printing });
    Plotly.react(node, traces(node), layout(node, printing),
      { ...CONFIG, staticPlot: printing });
    if (first) {
      node.on?.('plotly_relayout', (change) => follow(node, change));
      node.on?.('plotly_click', (change) => pick(node, change));
    }
  }

  /**
   * Show the same time in all plots of a run.
   *
   * @param {PlotNode} node
   * @param {Record<string, unknown>} change
   */
  function follow(node, change) {
    const whole = change['xaxis.autorange'] === true;
    const from = change['xaxis.range[0]'];
    const to = change['xaxis.range[1]'];
    if (printing || plots[node.id].plane || (!whole && from === undefined)) {
      return;
    }
    for (const other of drawn.keys()) {
      const axis = other.layout?.xaxis;
      // Each tells of its own change, too, some time later: then there is nothing left to do.
      const same = whole ? axis?.autorange : axis?.range?.[0] === from && axis?.range?.[1] === to;
      if (!same && runOf(other) === runOf(node) && !plots[other.id].plane) {
        Plotly.relayout(other, whole ? { 'xaxis.autorange': true }
          : { 'xaxis.range[0]': from, 'xaxis.range[1]': to });
      }
    }
  }

  /**
   * Mark a time in all plots of its run.
   *
   * @param {string} run
   * @param {number} time [s]
   */
  function choose(run, time) {
    chosen.set(run, time);
    for (const node of drawn.keys()) {
      if (runOf(node) === run && !plots[node.id].plane) {
        Plotly.relayout(node, { shapes: shapes(node) });
      }
    }
  }

  /**
   * A click into a plot marks its time, and the frame next to it.
   *
   * @param {PlotNode} node
   * @param {Record<string, unknown>} change
   */
  function pick(node, change) {
    const [point] = /** @type {{x: number}[]} */ (change.points ?? []);
    if (point === undefined || plots[node.id].plane) {
      return;
    }
    choose(runOf(node), point.x);
    let best = null;
    for (const frame of frames(runOf(node))) {
      frame.classList.remove('shown');
      const apart = Math.abs(Number(frame.dataset.time) - point.x);
      if (apart <= 1.0 && (best === null || apart < best.apart)) {
        best = { frame, apart };
      }
    }
    best?.frame.classList.add('shown');
  }

  /** @param {string} run */
  function frames(run) {
    return /** @type {HTMLElement[]} */ (
      [...document.querySelectorAll(`.frame[id^="${run}-"]`)]);
  }

  /** A time that leads to its frame is marked in the plots, too. */
  document.addEventListener('click', (event) => {
    const target = event.target instanceof Element ? event.target : null;
    const link = /** @type {HTMLElement|null} */ (target?.closest('a[data-time], .frame') ?? null);
    if (link === null) {
      return;
    }
    const address = link.getAttribute('href')?.slice(1) ?? link.id;
    const run = address.split('-', 1)[0];
    for (const frame of frames(run)) {
      frame.classList.toggle('shown', frame.id === address);
    }
    choose(run, Number(link.dataset.time));
  });

  function redraw() {
    for (const node of drawn.keys()) {
      draw(node);
    }
  }

  // Hidden plots are not drawn.
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const node = /** @type {PlotNode} */ (entry.target);
      if (entry.isIntersecting && !drawn.has(node)) {
        observer.unobserve(node);
        draw(node);
      }
    }
  }, { rootMargin: '300px' });
  nodes.forEach((node) => observer.observe(node));

  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if (!printing && window.innerWidth !== width) {
      width = window.innerWidth;
      redraw();
    }
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);

  window.addEventListener('beforeprint', () => {
    printing = true;
    // Paper is light, whatever the screen is.
    document.documentElement.style.colorScheme = 'light';
    nodes.forEach(draw);
  });
  window.addEventListener('afterprint', () => {
    printing = false;
    document.documentElement.style.colorScheme = '';
    redraw();
  });
})();
