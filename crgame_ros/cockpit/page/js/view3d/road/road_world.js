// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The world in which the vehicles of the 3D view are: road and ground. */

import { outlineOf } from '../../outline.js';
import { localOrigin } from '../local_origin.js';

/** @import { BufferGeometry, Group } from 'three' */
/** @import { Scene } from '../../messages.js' */
/** @import { Store } from '../../store.js' */

/** @typedef {typeof import('../three.js')} Three the library, as three.js exports it */
/** @typedef {{x: number, y: number, z: number}} Point from the local origin [m] */

/**
 * @typedef {object} RoadWorld
 * @property {Group} group what the scene of three.js gets: z up, metres from `localOrigin(scene)`
 * @property {(store: Store, now_ms: number, eye: Point) => void} update called before each
 *   picture, after `store.displayed(now_ms)`; eye is that of the main camera
 * @property {(x: number, y: number) => number} heightAt of the road at a point of the map [m]
 * @property {number} triangles in the whole group
 * @property {number} drawCalls at most, when all of it is seen
 * @property {() => void} dispose frees what the graphics card holds
 */

const GROUND = 0x6f8a5a;
const ROAD = 0x4a4e55;
const GROUND_BELOW_M = 0.03;
const MARGIN_M = 500;

/**
 * Make the world of a scene.
 *
 * @param {Three} three the library
 * @param {Scene} scene the scene document
 * @returns {RoadWorld}
 */
export function createRoadWorld(three, scene) {
  const group = new three.Group();
  const road = new three.Mesh(roadGeometry(three, scene),
    new three.MeshLambertMaterial({ color: ROAD }));
  const [xmin, ymin, xmax, ymax] = scene.bounds;
  const ground = new three.Mesh(
    new three.PlaneGeometry(xmax - xmin + MARGIN_M, ymax - ymin + MARGIN_M),
    new three.MeshLambertMaterial({ color: GROUND }));
  ground.position.z = -GROUND_BELOW_M;
  group.add(ground, road);
  return {
    group, update() {}, heightAt: () => 0,
    triangles: 2 + (road.geometry.index?.count ?? 0) / 3, drawCalls: 2,
    dispose() {
      for (const mesh of [road, ground]) {
        mesh.geometry.dispose();
        mesh.material.dispose();
      }
    },
  };
}

/**
 * @param {Three} three
 * @param {Scene} scene
 * @returns {BufferGeometry}
 */
function roadGeometry(three, scene) {
  const origin = localOrigin(scene);
  /** @type {number[]} */
  const positions = [];
  /** @type {number[]} */
  const indices = [];
  for (const lanelet of scene.lanelets) {
    const outline = outlineOf(lanelet);
    const first = positions.length / 3;
    const corners = [];
    for (let i = 0; i < outline.length; i += 2) {
      const corner = new three.Vector2(outline[i] - origin.x, outline[i + 1] - origin.y);
      corners.push(corner);
      positions.push(corner.x, corner.y, 0);
    }
    for (const face of three.ShapeUtils.triangulateShape(corners, [])) {
      indices.push(...face.map((index) => first + index));
    }
  }
  const geometry = new three.BufferGeometry();
  geometry.setAttribute('position', new three.Float32BufferAttribute(positions, 3));
  geometry.setIndex(indices);
  geometry.computeVertexNormals();
  return geometry;
}
