// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Draws the plots of a report with Plotly, and leads from times to frames and plots. */

export interface Line {
  name: string;
  colour: string; // name of a custom property
  dash: string;
  x: string; // 32-bit floats in base64
  y: string; // 64-bit floats in base64
}

export interface Plot {
  unit: string;
  plane: boolean;
  bounds: [number, number] | null;
  limits: { value: number; label: string }[];
  spans: { from: number; to: number; label: string; colour: string }[];
  lines: Line[];
}

export interface PlotNode extends HTMLElement {
  on?: (event: string, listener: (change: Record<string, unknown>) => void) => void;
  layout?: { xaxis?: { autorange?: boolean; range?: [number, number] } };
}

export type Draw = (node: HTMLElement, ...what: object[]) => Promise<unknown>;

(() => {
  const { Plotly } = window as unknown as { Plotly: Record<'react' | 'relayout', Draw> };
  // Of a plot on paper, two of them beside each other [CSS px].
  const PAPER = { width: 336, height: 196 };
  const PAPER_PLANE = { width: 690, height: 340 };
  const CONFIG = { displaylogo: false, displayModeBar: false, responsive: false };

  const plots: Record<string, Plot> = JSON.parse(
    document.getElementById('plots')?.textContent ?? '{}');
  const decoded = new Map<string, { x: Float32Array; y: Float64Array }[]>();
  const drawn = new Set<PlotNode>();
  /** The chosen time of each run [s]. */
  const chosen = new Map<string, number>();
  const nodes = [...document.querySelectorAll<PlotNode>('.plot')];
  let printing = false;

  /** @param text base64 */
  function bytes(text: string) {
    return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  }

  // light-dark() is only resolved where it is used: each colour is asked of an element.
  const probe = document.createElement('span');
  probe.hidden = true;
  document.body.append(probe);

  /** @param name of a colour */
  function colour(name: string) {
    probe.style.color = `var(--${name})`;
    return getComputedStyle(probe).color;
  }

  function runOf(node: PlotNode) {
    return node.id.split('-', 1)[0];
  }

  function values(node: PlotNode) {
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

  function traces(node: PlotNode) {
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

  function shapes(node: PlotNode) {
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

  function layout(node: PlotNode, paper: boolean) {
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

  function draw(node: PlotNode) {
    const first = !drawn.has(node);
    drawn.add(node);
    Plotly.react(node, traces(node), layout(node, printing),
      { ...CONFIG, staticPlot: printing });
    if (first) {
      node.on?.('plotly_relayout', (change) => follow(node, change));
      node.on?.('plotly_click', (change) => pick(node, change));
    }
  }

  /** Show the same time in all plots of a run. */
  function follow(node: PlotNode, change: Record<string, unknown>) {
    const whole = change['xaxis.autorange'] === true;
    const from = change['xaxis.range[0]'];
    const to = change['xaxis.range[1]'];
    if (printing || plots[node.id].plane || (!whole && from === undefined)) {
      return;
    }
    for (const other of drawn) {
      const axis = other.layout?.xaxis;
      // Each tells of its own change, too, some time later: then there is nothing left to do.
      const same = whole ? axis?.autorange : axis?.range?.[0] === from && axis?.range?.[1] === to;
      if (!same && runOf(other) === runOf(node) && !plots[other.id].plane) {
        Plotly.relayout(other, whole ? { 'xaxis.autorange': true }
          : { 'xaxis.range[0]': from, 'xaxis.range[1]': to });
      }
    }
  }

  /** Mark a time in all plots of its run; `time` [s]. */
  function choose(run: string, time: number) {
    chosen.set(run, time);
    for (const node of drawn) {
      if (runOf(node) === run && !plots[node.id].plane) {
        Plotly.relayout(node, { shapes: shapes(node) });
      }
    }
  }

  /** A click into a plot marks its time, and the frame next to it. */
  function pick(node: PlotNode, change: Record<string, unknown>) {
    const [point] = (change.points ?? []) as { x: number }[];
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

  function frames(run: string) {
    return [...document.querySelectorAll(`.frame[id^="${run}-"]`)] as HTMLElement[];
  }

  /** A time that leads to its frame is marked in the plots, too. */
  document.addEventListener('click', (event) => {
    const target = event.target instanceof Element ? event.target : null;
    const link = (target?.closest('a[data-time], .frame') ?? null) as HTMLElement | null;
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
    for (const node of drawn) {
      draw(node);
    }
  }

  // Hidden plots are not drawn.
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const node = entry.target as PlotNode;
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
