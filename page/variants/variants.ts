// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Draws the variants of a game: parallel coordinates, and a map for each pair of dimensions. */

export interface Axis {
  name: string;
  low?: number;
  high?: number;
  values?: unknown[]; // of a dimension of names
}

export type Verdict = 'pass' | 'failure' | 'excused' | 'unknown';

export interface VariantPoint {
  cell: string; // key
  variant: Record<string, unknown>;
  values: (number | null)[]; // of the goals
  verdict: Verdict;
  told: string;
}

export interface Slice {
  x: string;
  y: string;
  probabilities: number[][]; // rows from low to high y
}

export interface Variants {
  axes: Axis[];
  goals: string[];
  nominal: Record<string, unknown>;
  points: VariantPoint[];
  slices: Slice[];
  links: Record<string, Record<string, string>>; // address by what it is, by cell
  command: string; // that makes the report of a cell, without its key
}

(() => {
  const NAMESPACE = 'http://www.w3.org/2000/svg';
  // Of the pictures, in their own units.
  const LINES = { width: 960, height: 340, top: 34, bottom: 26, side: 70 };
  const MAP = { size: 260, left: 62, bottom: 34, edge: 8 };
  const ORDER: Verdict[] = ['unknown', 'pass', 'excused', 'failure'];
  const NAMES: Record<Verdict, string> = {
    pass: 'kept', failure: 'failure', excused: 'no AV to blame', unknown: 'could not be run' };

  const data: Variants = JSON.parse(document.getElementById('data')?.textContent ?? '{}');
  const points = [...data.points].sort(
    (first, second) => ORDER.indexOf(first.verdict) - ORDER.indexOf(second.verdict));
  const marks = new Map<string, SVGElement[]>();

  /** @param parent to which the new element is added */
  function svg(parent: Element, name: string, attributes: Record<string, string | number>) {
    const made = document.createElementNS(NAMESPACE, name);
    for (const [key, value] of Object.entries(attributes)) {
      made.setAttribute(key, String(value));
    }
    parent.append(made);
    return made;
  }

  function text(parent: Element, label: string, x: number, y: number, kind: string) {
    svg(parent, 'text', { x, y, class: kind }).textContent = label;
  }

  /** Return the place of a value on its axis, 0 to 1; null where it has none. */
  function place(axis: Axis, value: unknown): number | null {
    if (axis.values) {
      const index = axis.values.findIndex(
        (each) => JSON.stringify(each) === JSON.stringify(value));
      return index < 0 ? null : (index + 0.5) / axis.values.length;
    }
    if (typeof value !== 'number') {
      return null;
    }
    const { low = 0, high = 1 } = axis;
    return Math.min(1, Math.max(0, (value - low) / (high - low || 1)));
  }

  function ends(axis: Axis): [string, string] {
    return axis.values
      ? [String(axis.values[0]), String(axis.values[axis.values.length - 1])]
      : [short(axis.low ?? 0), short(axis.high ?? 1)];
  }

  function short(value: unknown) {
    return typeof value === 'number' ? String(Number(value.toPrecision(4))) : String(value);
  }

  /** Return the axis of a goal, as wide as its values are. */
  function goalAxis(name: string, index: number): Axis {
    const values = points.map((point) => point.values[index]).filter((value) => value !== null);
    return { name, low: Math.min(...values), high: Math.max(...values) };
  }

  function clickable(mark: SVGElement, point: VariantPoint) {
    svg(mark, 'title', {}).textContent = words(point);
    mark.addEventListener('click', () => show(point));
    marks.set(point.cell, [...marks.get(point.cell) ?? [], mark]);
  }

  function words(point: VariantPoint) {
    const values = Object.entries(point.variant).map(([name, value]) => `${name} ${short(value)}`);
    const goals = data.goals.map((name, index) => `${name} ${short(point.values[index] ?? '–')}`);
    return `${NAMES[point.verdict]}: ${[...values, ...goals].join(', ')}`;
  }

  function drawLines(box: Element) {
    const { width, height, top, bottom, side } = LINES;
    const picture = svg(box, 'svg', { viewBox: `0 0 ${width} ${height}`, class: 'lines',
      role: 'img', 'aria-label': 'Variants as lines over all dimensions' });
    // A goal without any value, as where no variant could be run, has no axis.
    const valued = [...data.goals.keys()].filter(
      (index) => points.some((point) => point.values[index] !== null));
    const columns = [...data.axes, ...valued.map((index) => goalAxis(data.goals[index], index))];
    const step = (width - 2 * side) / Math.max(1, columns.length - 1);
    const y = (share: number) => top + (1 - share) * (height - top - bottom);
    for (const point of points) {
      const values = [...data.axes.map((axis) => point.variant[axis.name]),
        ...valued.map((index) => point.values[index])];
      const corners = columns.flatMap((axis, index) => {
        const share = place(axis, values[index]);
        return share === null ? [] : [`${side + index * step},${y(share).toFixed(1)}`];
      });
      clickable(svg(picture, 'polyline', { points: corners.join(' '), class: point.verdict }),
        point);
    }
    columns.forEach((axis, index) => {
      const x = side + index * step;
      svg(picture, 'line', { x1: x, x2: x, y1: y(0), y2: y(1), class: 'axis' });
      text(picture, axis.name, x, top - 20, 'name');
      const [low, high] = ends(axis);
      text(picture, high, x, top - 6, 'tick');
      text(picture, low, x, height - bottom + 16, 'tick');
    });
  }

  function drawMap(box: Element, first: Axis, second: Axis) {
    const { size, left, bottom, edge } = MAP;
    const picture = svg(box, 'svg', { viewBox: `0 0 ${left + size + edge} ${size + bottom + edge}`,
      class: 'map', role: 'img', 'aria-label': `Variants by ${first.name} and ${second.name}` });
    const x = (share: number) => left + share * size;
    const y = (share: number) => edge + (1 - share) * size;
    const slice = data.slices.find((each) => each.x === first.name && each.y === second.name);
    if (slice) {
      const cell = size / slice.probabilities.length;
      slice.probabilities.forEach((row, j) => row.forEach((probability, i) => {
        svg(picture, 'rect', { x: left + i * cell, y: edge + size - (j + 1) * cell,
          width: cell + 0.2, height: cell + 0.2, 'fill-opacity': (0.45 * probability).toFixed(3),
          class: 'probability' });
      }));
    }
    svg(picture, 'rect', { x: left, y: edge, width: size, height: size, class: 'frame' });
    for (const point of points) {
      const [across, up] = [place(first, point.variant[first.name]),
        place(second, point.variant[second.name])];
      if (across !== null && up !== null) {
        clickable(svg(picture, 'circle', { cx: x(across).toFixed(1), cy: y(up).toFixed(1), r: 2.6,
          class: point.verdict }), point);
      }
    }
    const nominal = [place(first, data.nominal[first.name]),
      place(second, data.nominal[second.name])];
    if (nominal[0] !== null && nominal[1] !== null) {
      const [cx, cy] = [x(nominal[0]), y(nominal[1])];
      svg(picture, 'path', { d: `M${cx - 6},${cy}h12M${cx},${cy - 6}v12`, class: 'nominal' });
    }
    const [[low, high], [down, above]] = [ends(first), ends(second)];
    text(picture, low, left, size + edge + 14, 'start');
    text(picture, high, left + size, size + edge + 14, 'end');
    text(picture, first.name, left + size / 2, size + edge + 28, 'name');
    text(picture, above, left - 4, edge + 10, 'end');
    text(picture, down, left - 4, edge + size, 'end');
    const name = svg(picture, 'text', { class: 'name',
      transform: `translate(12 ${edge + size / 2}) rotate(-90)` });
    name.textContent = second.name;
  }

  /** Show a variant, and how to see its run. */
  function show(point: VariantPoint) {
    for (const mark of document.querySelectorAll('.chosen')) {
      mark.classList.remove('chosen');
    }
    for (const mark of marks.get(point.cell) ?? []) {
      mark.classList.add('chosen');
      mark.parentElement?.append(mark);
    }
    const box = document.getElementById('chosen');
    if (!box) {
      return;
    }
    const line = document.createElement('p');
    line.textContent = words(point) + (point.told ? ` (${point.told})` : '');
    const seen = document.createElement('p');
    const links = Object.entries(data.links[point.cell] ?? {});
    for (const [name, address] of links) {
      const link = document.createElement('a');
      link.href = address;
      link.textContent = name;
      seen.append(link, ' ');
    }
    if (!links.length) {
      const command = document.createElement('code');
      command.textContent = `${data.command} ${point.cell.slice(0, 12)}`;
      seen.append('Run it again, and see it: ', command);
    }
    box.replaceChildren(line, seen);
  }

  const lines = document.getElementById('lines');
  const maps = document.getElementById('maps');
  if (lines && maps) {
    drawLines(lines);
    data.axes.forEach((first, index) => {
      for (const second of data.axes.slice(index + 1)) {
        drawMap(maps, first, second);
      }
    });
  }
})();
