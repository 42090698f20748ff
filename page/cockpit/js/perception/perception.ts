// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The followed AV's perception over the true world: layers, their buttons and a legend. */

import { element, setAttribute, setText, svg } from '../dom.js';
import { OBJECT_WIDTH, VEHICLE_WIDTH } from '../frames.js';
import { recall, remember } from '../panels/memory.js';
import { press, toolButton } from '../world/toolbar.js';
import { EstimateLayer, RayLayer } from './estimate_layer.js';
import { countText, Unseen } from './unseen.js';

import type { Connection } from '../connection.js';
import type { OccupancyFrame } from '../frames.js';
import type { Store } from '../store.js';
import type { DrawLayer, LiveView, Place, View } from '../world/painter.js';
import type { World } from '../world/world.js';

export type LayerName = 'unseen' | 'rays' | 'estimate' | 'occupancy';

interface Layer {
  strokes: string; // of its button
  title: string;
  first: boolean; // whether it is on at first
  needsAv: boolean; // that perceives
  entry: [strokes: string, words: string]; // of the legend, in a box of 28 x 16; $ is the AV
}

const LAYERS: Record<LayerName, Layer> = {
  unseen: { strokes: 'M3 3l18 18M10 6a9 9 0 0 1 11 6a12 12 0 0 1-3 4M6 8a12 12 0 0 0-3 4'
    + 'a9 9 0 0 0 12 5', title: 'Outlines of objects that the followed AV does not see',
  first: true, needsAv: true, entry: ['M14 2a6 6 0 1 0 .01 0z', 'not seen by $'] },
  rays: { strokes: 'M4 12L20 4M4 12h16M4 12l16 8M3 12h.01', title: 'Rays of its sensors',
    first: false, needsAv: true, entry: ['M2 14L26 2V14z', 'what the sensors of $ reach'] },
  estimate: { strokes: 'M3 8h3M10 8h4M18 8h3v3M21 14v2h-3M14 16h-4M6 16H3v-2M3 11V8',
    title: 'Its estimated pose', first: false, needsAv: true,
    entry: ['M3 4h22v8H3z', 'estimated pose of $, 2σ'] },
  occupancy: { strokes: 'M3 3h8v8H3zM13 13h8v8h-8zM13 3h8v8h-8z', title: 'Permanent obstacles',
    first: true, needsAv: false,
    entry: ['M3 3h10v10H3zM15 3h10v10H15z', 'permanent obstacles'] },
};

// Prefix of layer names: another part may have a layer called rays.
const PREFIX = 'perception_';
const COUNT_EVERY_MS = 200;
const NAMES = Object.keys(LAYERS) as LayerName[];

/** The layers of perception of one world. */
export class Perception {
  #store;
  #connection;
  #world: World = window.crgame.world;
  #unseen: Unseen | null = null;
  #flags: Uint8Array | null = null;
  #on: Partial<Record<LayerName, boolean>> = {};
  #buttons = new Map<LayerName, HTMLButtonElement>();
  #group;
  #rays = new RayLayer();
  #estimate = new EstimateLayer();
  #occupancy = new OccupancyLayer();
  #legend;
  #sentLayers = '';
  #legended = '';

  /** @param stage that holds the canvas */
  constructor(stage: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    this.#legend = createLegend(stage);
    this.#addLayers();
    this.#group = element('div', { class: 'world-group' });
    stage.querySelector('.world-toolbar')?.append(this.#group);
    this.#addButtons();
    store.on('scene', () => this.#load());
    store.on('hello', () => {
      this.#sentLayers = '';
      this.#sendLayers();
    });
    setInterval(() => this.#showCount(stage), COUNT_EVERY_MS);
    this.#load();
  }

  /** Return the ids of the present objects that are drawn as outlines. */
  get hollow() {
    const { shown } = this.#world;
    const { vehicles, objects } = this.#store.scene ?? { vehicles: [], objects: [] };
    const flags = this.#flags;
    return shown === null || flags === null ? [] : [...vehicles, ...objects]
      .filter((_, column) => flags[column] === 1 && Number.isFinite(
        column < vehicles.length ? shown.vehicles[column * VEHICLE_WIDTH]
          : shown.objects[(column - vehicles.length) * OBJECT_WIDTH]))
      .map(({ id }) => id);
  }

  /** Return how many fans of rays are drawn. */
  get fans() {
    return this.#shows('rays') ? this.#rays.drawn : 0;
  }

  /** Return the estimate as drawn last, null for none. */
  get estimate() {
    return this.#shows('estimate') ? this.#estimate.drawn : null;
  }

  /** Return how many occupied cells are on the map as drawn last. */
  get occupied() {
    return this.#shows('occupancy') ? this.#occupancy.drawn : 0;
  }

  /** Return how many of the near objects the followed AV sees: null unless it perceives. */
  get count(): { seen: number; near: number; range: number | null } | null {
    const { shown } = this.#world;
    const av = this.#av();
    const columns = shown === null || av < 0 ? null
      : this.#store.perceived.seenBy(av, shown.t);
    return columns === null || shown === null ? null
      : this.#unseen?.count(av, columns, shown) ?? null;
  }

  /**
   * Show or hide a layer, and remember it.
   * @param name unseen, rays, estimate or occupancy
   * @param on whether it is shown
   */
  set(name: LayerName, on: boolean) {
    this.#on[name] = on;
    remember(`layer.${name}`, on ? 'on' : 'off');
    if (name !== 'unseen') {
      this.#world.setLayer(PREFIX + name, on);
    }
    const button = this.#buttons.get(name);
    if (button !== undefined) {
      press(button, on);
    }
    this.#sendLayers();
    this.#world.redraw();
  }

  #addLayers() {
    const world = this.#world;
    world.drawHollow((view) => this.#choose(view));
    const add = (name: LayerName, draw: DrawLayer, where: Place) => (
      world.addLayer(PREFIX + name, (context, view) => {
        if (view.insight) {
          draw(context, view);
        }
      }, where));
    add('occupancy', (context, view) => this.#occupancy.draw(context, view), 'below');
    add('rays', (context, view) => this.#rays.draw(context, view, this.#av()), 'below');
    add('estimate', (context, view) => this.#estimate.draw(
      context, view, world.vehicle(this.#av()), this.#av()), 'above');
  }

  /** Return whether a layer is drawn: in the 3D view only if it is requested there. */
  #shows(name: LayerName) {
    return Boolean(this.#on[name]) && this.#world.insight;
  }

  #addButtons() {
    for (const name of NAMES) {
      const { strokes, title, first } = LAYERS[name];
      const button = toolButton(this.#group, strokes, title,
        () => this.set(name, !this.#on[name]));
      button.dataset.layer = name;
      this.#buttons.set(name, button);
      const kept = recall(`layer.${name}`);
      this.set(name, kept === '' ? first : kept === 'on');
    }
  }

  #load() {
    const { scene } = this.#store;
    this.#unseen = scene === null ? null : new Unseen(scene);
    const perceiving = scene?.vehicles.some(({ perception }) => perception) ?? false;
    for (const [name, button] of this.#buttons) {
      button.hidden = LAYERS[name].needsAv ? !perceiving : !scene?.occupancy;
    }
    this.#group.hidden = !perceiving && !scene?.occupancy;
    this.#sendLayers();
  }

  /** Return the index of the followed AV if its perception may be shown, else -1. */
  #av() {
    const av = this.#unseen?.perceiving(this.#world.followed) ?? -1;
    return Number.isNaN(this.#world.shown?.vehicles[av * VEHICLE_WIDTH]) ? -1 : av;
  }

  /** Send the wanted layers to the server, if they have changed. */
  #sendLayers() {
    const perception = this.#av() < 0 ? '' : this.#world.followed ?? '';
    const scans = Boolean(this.#on.rays);
    const told = `${perception} ${scans}`;
    if (told !== this.#sentLayers
        && this.#connection?.send({ type: 'layers', perception, scans })) {
      this.#sentLayers = told;
    }
  }

  #showLegend() {
    const av = this.#av();
    const names = NAMES.filter((name) => this.#on[name]
      && (name === 'occupancy' ? this.#store.scene?.occupancy : av >= 0));
    const followed = this.#world.followed ?? '';
    const known = this.#flags !== null;
    const text = `${names.join()} ${followed} ${known}`;
    if (text !== this.#legended) {
      this.#legended = text;
      this.#legend.show(names, followed, known);
    }
  }

  /** Choose the objects that are drawn as outlines, in each frame. */
  #choose({ store, shown }: LiveView) {
    this.#sendLayers();
    const av = this.#shows('unseen') ? this.#av() : -1;
    const columns = av < 0 ? null : store.perceived.seenBy(av, shown.t);
    this.#flags = columns === null ? null : this.#unseen?.flags(av, columns) ?? null;
    this.#showLegend();
    return this.#flags;
  }

  /** Show in the instruments how many of the near objects are seen. */
  #showCount(stage: HTMLElement) {
    const line = stage.querySelector('.hud-seen');
    if (line !== null) {
      const count = this.#world.insight ? this.count : null;
      setText(line, count === null ? '' : countText(count));
      setAttribute(line, 'hidden', count === null);
    }
  }
}

// Replaces the first entry of the legend while the planner's knowledge is unknown.
const UNKNOWN = 'what $ sees is not known now';

/** Put the legend on the stage; its styles are in world.css. */
function createLegend(stage: HTMLElement) {
  const root = element('ul', { class: 'world-legend', 'aria-label': 'Legend', hidden: true });
  const rows = NAMES.map((name) => {
    const [strokes, words] = LAYERS[name].entry;
    const text = element('span', {});
    const row = element('li', { 'data-layer': name, hidden: true },
      svg('svg', { viewBox: '0 0 28 16', 'aria-hidden': 'true' }, svg('path', { d: strokes })),
      text);
    root.append(row);
    return { name, words, row, text };
  });
  stage.append(root);
  return {
    /**
     * Show the entries of the named layers on the map.
     * @param av id of the AV that is followed
     * @param known whether it is known what it sees
     */
    show(names: LayerName[], av: string, known: boolean) {
      for (const { name, words, row, text } of rows) {
        setText(text, (name === 'unseen' && !known ? UNKNOWN : words).replace('$', av));
        setAttribute(row, 'hidden', !names.includes(name));
      }
      setAttribute(root, 'hidden', names.length === 0);
    },
  };
}

// Cells smaller than this on the screen are merged by fours, repeatedly [px].
const LEAST_PX = 0.75;
const COARSEST = 6;

interface Level {
  coarseness: number; // its cells are 2 to the power of this as long as the map's
  rows: number;
  columns: number;
  cells: Uint8Array;
  picture: HTMLCanvasElement | null;
}

/** The layer that draws the store's map as a picture in the theme's colour. */
class OccupancyLayer {
  /** Number of occupied cells in the map that was drawn last. */
  drawn = 0;
  #map: OccupancyFrame | null = null;
  #color = '';
  #levels: Level[] = [];

  /** Draw the map; `view` as layers get it. */
  draw(context: CanvasRenderingContext2D, { camera, palette, ratio, store }: View) {
    const map = store.perceived.occupancy;
    if (map === null) {
      this.drawn = 0;
      return;
    }
    if (map !== this.#map) {
      this.#map = map;
      const first = firstLevel(map);
      this.#levels = [first];
      this.drawn = first.cells.reduce((sum, cell) => sum + cell, 0);
    }
    if (palette.occupied !== this.#color) {
      this.#color = palette.occupied;
      this.#levels.forEach((level) => { level.picture = null; });
    }
    if (this.drawn === 0) {
      return;
    }
    const level = this.#level(map.resolution * camera.scale * ratio);
    const edge = map.resolution * 2 ** level.coarseness;
    level.picture ??= paint(level, this.#color);
    camera.enterMap(context, ratio, map.x, map.y);
    context.imageSmoothingEnabled = false;
    context.drawImage(level.picture, 0, 0, level.columns * edge, level.rows * edge);
  }

  /** Return the finest level whose cells are large enough on the screen. */
  #level(cell_px: number): Level {
    let wanted = 0;
    while (wanted < COARSEST && cell_px * 2 ** wanted < LEAST_PX) {
      wanted += 1;
    }
    while (this.#levels.length <= wanted) {
      this.#levels.push(coarser(this.#levels[this.#levels.length - 1]));
    }
    return this.#levels[wanted];
  }
}

function firstLevel({ rows, columns, bits }: OccupancyFrame): Level {
  const cells = new Uint8Array(rows * columns);
  for (let i = 0; i < cells.length; i += 1) {
    cells[i] = bits[i >> 3] >> (i & 7) & 1;
  }
  return { coarseness: 0, rows, columns, cells, picture: null };
}

/** Merge four cells into one, which is occupied if any of them is, so that no wall gets lost. */
function coarser({ coarseness, rows, columns, cells }: Level): Level {
  const height = Math.ceil(rows / 2);
  const width = Math.ceil(columns / 2);
  const joined = new Uint8Array(height * width);
  for (let row = 0; row < rows; row += 1) {
    const into = (row >> 1) * width;
    for (let column = 0; column < columns; column += 1) {
      joined[into + (column >> 1)] |= cells[row * columns + column];
    }
  }
  return {
    coarseness: coarseness + 1, rows: height, columns: width, cells: joined, picture: null,
  };
}

function paint({ rows, columns, cells }: Level, color: string) {
  const canvas = document.createElement('canvas');
  canvas.width = columns;
  canvas.height = rows;
  const context = canvas.getContext('2d') as CanvasRenderingContext2D;
  const image = context.createImageData(columns, rows);
  for (let i = 0; i < cells.length; i += 1) {
    image.data[4 * i + 3] = 255 * cells[i];
  }
  context.putImageData(image, 0, 0);
  context.globalCompositeOperation = 'source-in';
  context.fillStyle = color;
  context.fillRect(0, 0, columns, rows);
  return canvas;
}
