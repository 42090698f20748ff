// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Traffic lights: poles, housings, and lamps that show the signals of the run. */

import { LIT } from '../../lights.js';
import { geometryOf } from './materials.js';
import { MeshParts } from './mesh_parts.js';
import { NearInstances } from './near_instances.js';
import { upright } from '../solid_boxes.js';
import { addBox, addRound } from './scenery_shapes.js';
import { PlateQuads, plateTexture } from './signs.js';
import { SYMBOLS } from './sign_symbols.js';

import type { BufferAttribute, Material } from 'three';
import type { Origin } from '../local_origin.js';
import type { Heights } from './mesh_parts.js';
import type { LightPole } from './poles.js';
import type { Cell } from './sign_atlas.js';
import type { Sight } from '../seen_instances.js';
import type { Instance } from './near_instances.js';
import type { Three } from '../three.js';
import type { Named } from '../contents.js';
import type { Triple } from '../solid_boxes.js';

/** Lamps from the top. */
const LAMPS = ['red', 'yellow', 'green'] as const;
const COLORS = { red: 0xff3b2c, yellow: 0xffc21f, green: 0x1fe08a };
const OFF = 0x24272b;
/** Middle of the lowest lamp above the road [m]. */
const LOWEST_M = 2.45;
const HANGING_M = 5;
const APART_M = 0.33;
const LAMP_M = 0.28;
const HOUSING_M = 0.14;
/** Corners of the board behind the lamps, from the lowest one's middle. */
const BOARD: [low: Triple, high: Triple] = [[-0.02, -0.32, -0.34],
  [0.02, 0.32, 2 * APART_M + 0.34]];
const MOST = 200;
const REACH_M = 700;
const MASK_PX = 128;
const ARROWS: Record<string, string[]> = {
  left: ['across-left'], right: ['across-right'], straight: ['up'],
  leftStraight: ['across-left', 'up'], straightRight: ['up', 'across-right'],
  leftRight: ['across-left', 'across-right'], all: [],
};

/** All traffic lights of a scene. */
export class TrafficLights {
  /** The board of each light. */
  solids: Named[];
  #three;
  #lights;
  #texture;
  #lamps;
  #standing: NearInstances[]; // poles and housings
  #shown: (string | undefined)[];

  /** @param painted of poles and housings */
  constructor(three: Three, lights: LightPole[], origin: Origin, heights: Heights,
    painted: Material) {
    this.#three = three;
    this.#lights = lights;
    this.#shown = lights.map(() => undefined);
    const masks = lampMasks();
    const quads = new PlateQuads(origin);
    const instance = (pole: LightPole, z: number): Instance => ({
      x: pole.x - origin.x, y: pole.y - origin.y, z, yaw: pole.yaw, size: [1, 1, 1],
      color: 0xffffff });
    const feet = lights.map(({ x, y }) => heights(x, y));
    const bases = lights.map(({ hangs }, i) => feet[i] + (hangs ? HANGING_M : LOWEST_M));
    this.solids = lights.map(({ x, y, yaw, light }, i) => ({ kind: 'traffic_light',
      id: String(light.id), ...upright(x - origin.x, y - origin.y, yaw,
        above(BOARD[0], bases[i]), above(BOARD[1], bases[i])) }));
    lights.forEach((pole, i) => {
      LAMPS.forEach((_, lamp) => quads.add(
        pole.x - (HOUSING_M + 0.02) * Math.cos(pole.yaw),
        pole.y - (HOUSING_M + 0.02) * Math.sin(pole.yaw), bases[i] + (2 - lamp) * APART_M,
        pole.yaw, LAMP_M, masks.cells[pole.light.direction] ?? masks.cells.all));
    });
    const geometry = quads.geometry(three);
    geometry.setAttribute('color', new three.BufferAttribute(
      new Float32Array(quads.positions.length), 3));
    this.#texture = plateTexture(three, masks.canvas);
    this.#lamps = new three.Mesh(geometry, new three.MeshBasicMaterial({
      vertexColors: true, map: this.#texture, alphaTest: 0.5, toneMapped: false }));
    const poles = lights.map((pole, i) => instance(pole, feet[i])).filter(
      (_, i) => !lights[i].hangs);
    const housings = lights.map((pole, i) => instance(pole, bases[i]));
    this.#standing = [[poleShape(), poles] as const, [housingShape(), housings] as const].map(
      ([shape, places]) => new NearInstances(three, geometryOf(three, shape), painted, places,
        MOST, REACH_M));
    this.update({}, { x: 0, y: 0 });
  }

  get meshes() {
    return [this.#lamps, ...this.#standing.flatMap(({ meshes }) => meshes)];
  }

  get triangles() {
    return this.#standing.reduce((sum, { triangles }) => sum + triangles, 6 * this.#lights.length);
  }

  /** Show the signals; `states` by the lights' ids. */
  update(states: Record<string, string>, eye: { x: number; y: number }) {
    this.#standing.forEach((part) => part.update(eye));
    const colors = this.#lamps.geometry.attributes.color as BufferAttribute;
    const color = new this.#three.Color();
    this.#lights.forEach(({ light }, i) => {
      const state = states[light.id] ?? 'inactive';
      if (state === this.#shown[i]) {
        return;
      }
      this.#shown[i] = state;
      LAMPS.forEach((lamp, k) => {
        color.set(LIT[state]?.includes(lamp) ? COLORS[lamp] : OFF);
        for (let corner = 0; corner < 4; corner += 1) {
          colors.setXYZ(12 * i + 4 * k + corner, color.r, color.g, color.b);
        }
      });
      colors.needsUpdate = true;
    });
  }

  /** @param sight of the camera that draws next */
  see(sight: Sight) {
    this.#standing.forEach((part) => part.see(sight));
  }

  /** Free the memory of the graphics card. */
  dispose() {
    this.#texture.dispose();
    this.#lamps.geometry.dispose();
    this.#lamps.material.dispose();
    this.#standing.forEach((part) => part.dispose());
  }
}

function above([x, y, z]: Triple, base: number): Triple {
  return [x, y, z + base];
}

/** Draw the masks of lamps, by direction. */
export function lampMasks(): { canvas: HTMLCanvasElement; cells: Record<string, Cell> } {
  const canvas = document.createElement('canvas');
  const names = Object.keys(ARROWS);
  canvas.width = MASK_PX * 8;
  canvas.height = MASK_PX;
  const context = canvas.getContext('2d') as CanvasRenderingContext2D;
  const cells: Record<string, Cell> = {};
  names.forEach((name, i) => {
    context.save();
    context.translate((i + 0.5) * MASK_PX, MASK_PX / 2);
    context.scale(0.48 * MASK_PX, 0.48 * MASK_PX);
    context.fillStyle = '#ffffff';
    const arrows = ARROWS[name];
    if (arrows.length === 0) {
      context.beginPath();
      context.arc(0, 0, 1, 0, 2 * Math.PI);
      context.fill();
    }
    context.scale(1.15, 1.15);
    arrows.forEach((arrow) => SYMBOLS[arrow](context));
    context.restore();
    cells[name] = [i / 8, 0, (i + 1) / 8, 1];
  });
  return { canvas, cells };
}

/** The pole of a light that is not above the road. */
function poleShape() {
  const parts = new MeshParts({ x: 0, y: 0 });
  addRound(parts, [[0.07, -0.3], [0.06, LOWEST_M + 2.6 * APART_M]], [120, 124, 128]);
  return parts;
}

/** Three lamps' housing with its board; its origin is the lowest lamp's middle. */
function housingShape() {
  const parts = new MeshParts({ x: 0, y: 0 });
  addBox(parts, [-HOUSING_M, -0.19, -0.2], [0.06, 0.19, 2 * APART_M + 0.2], [34, 37, 40]);
  addBox(parts, ...BOARD, [28, 30, 33]);
  return parts;
}
