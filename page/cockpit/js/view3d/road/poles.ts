// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Places of the poles of signs and traffic lights: as in the map, but never on a lane. */

import type { Lanelet, Light, Scene, Sign } from '../../messages.js';
import type { RoadIndex } from './road_index.js';

/** A pole with its plates or lamps, for traffic with heading `yaw`. */
export interface Pole {
  x: number;
  y: number;
  yaw: number; // [rad]
  hangs: boolean; // above the road, if there is no room beside it
}

export interface SignPole extends Pole { id: number; plates: { kind: string; value: string }[] }
export interface LightPole extends Pole { light: Light }

// Room around a pole, and how far from its place it may be put [m].
const ROOM_M = 0.45;
const FARTHEST_M = 14;
const STEP_M = 0.25;
// Least distance of two equal signs for the same heading [m].
const SAME_SIGN_M = 15;
const LIGHTS_APART_M = 0.7;

/** Find a place for a pole: as in the map, else to the right of its traffic, or the left. */
function poleAt({ x, y, yaw }: { x: number; y: number; yaw: number },
  index: RoadIndex): Pole {
  const right = { x: Math.sin(yaw), y: -Math.cos(yaw) };
  for (const side of [1, -1]) {
    for (let aside = 0; aside <= FARTHEST_M; aside += STEP_M) {
      const place = { x: x + side * aside * right.x, y: y + side * aside * right.y };
      if (index.isClear(place.x, place.y, ROOM_M)) {
        return { ...place, yaw, hangs: false };
      }
    }
  }
  return { x, y, yaw, hangs: true };
}

/**
 * Place the signs of a scene.
 *
 * A sign that the map repeats for each lanelet, as most limits, gets one plate for all lanes,
 * where it begins to apply.
 * @param index of its lanelets
 */
export function placeSigns({ signs, lanelets }: Pick<Scene, 'signs' | 'lanelets'>,
  index: RoadIndex): SignPole[] {
  const told = new ToldBefore(signs, lanelets);
  const poles = new Map<number, SignPole>();
  const placed: SignPole[] = [];
  for (const sign of signs) {
    const plate = { kind: sign.kind, value: sign.value };
    const pole = poles.get(sign.id);
    if (pole !== undefined) {
      pole.plates.push(plate);
    } else if (!sign.virtual || !told.has(sign)) {
      const found = { ...poleAt(sign, index), id: sign.id, plates: [plate] };
      if (!placed.some((other) => isSame(other, found))) {
        placed.push(found);
        poles.set(sign.id, found);
      }
    }
  }
  return placed;
}

/**
 * Place the traffic lights of a scene; those at one place stand side by side.
 * @param index of its lanelets
 */
export function placeLights({ lights }: Pick<Scene, 'lights'>, index: RoadIndex): LightPole[] {
  const placed: LightPole[] = [];
  for (const light of lights) {
    const pole = { ...poleAt(light, index), light };
    while (placed.some(({ x, y }) => Math.hypot(x - pole.x, y - pole.y) < LIGHTS_APART_M - 0.01)) {
      pole.x += LIGHTS_APART_M * Math.sin(pole.yaw);
      pole.y -= LIGHTS_APART_M * Math.cos(pole.yaw);
    }
    placed.push(pole);
  }
  return placed;
}

/** A record of signs, to find those that repeat a sign before or beside them. */
class ToldBefore {
  #said = new Map<number, Set<string>>(); // what the signs of a lanelet say
  #lanelets: Map<number, Lanelet>;
  #predecessors = new Map<number, number[]>();

  constructor(signs: Sign[], lanelets: Lanelet[]) {
    this.#lanelets = new Map(lanelets.map((lanelet) => [lanelet.id, lanelet]));
    for (const sign of signs) {
      for (const id of sign.lanelets) {
        this.#said.set(id, (this.#said.get(id) ?? new Set()).add(wordsOf(sign)));
      }
    }
    for (const { id, successors } of lanelets) {
      for (const successor of successors) {
        this.#predecessors.set(successor, [...this.#predecessors.get(successor) ?? [], id]);
      }
    }
  }

  /** @returns whether all of its lanelets have it already */
  has(sign: Sign): boolean {
    const says = (id: number) => this.#said.get(id)?.has(wordsOf(sign)) ?? false;
    return sign.lanelets.length > 0 && sign.lanelets.every((id) => {
      const before = this.#predecessors.get(id) ?? [];
      const lanelet = this.#lanelets.get(id);
      const beside = lanelet?.adj_right_same ? lanelet.adj_right : null;
      return (before.length > 0 && before.every(says)) || (beside !== null && beside !== undefined
        && says(beside));
    });
  }
}

function wordsOf({ kind, value }: { kind: string; value: string }) {
  return `${kind} ${value}`;
}

function isSame(one: SignPole, other: SignPole) {
  return Math.hypot(one.x - other.x, one.y - other.y) < SAME_SIGN_M
    && Math.cos(one.yaw - other.yaw) > 0.8
    && wordsOf(one.plates[0]) === wordsOf(other.plates[0]);
}
