// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The surroundings in the 3D view: roads, roadside objects, land and sky. */

import { localOrigin } from '../local_origin.js';
import { Atmosphere } from './atmosphere.js';
import { buildLand } from './land.js';
import { geometryOf, GRAIN_ANISOTROPY, grainTexture, paintedMaterial } from './materials.js';
import { buildRoads } from './road_chunks.js';
import { Obstacles } from './obstacles.js';
import { placeLights, placeSigns } from './poles.js';
import { RoadIndex } from './road_index.js';
import { placeRoadside } from './roadside.js';
import { Scenery } from './scenery.js';
import { Signs } from './signs.js';
import { TrafficLights } from './traffic_lights.js';

/** @import { FogExp2, Group, Mesh, Object3D } from 'three' */
/** @import { MeshParts } from './mesh_parts.js' */
/** @import { Environment, Scene } from '../../messages.js' */
/** @import { Store } from '../../store.js' */
/** @import { Sight } from '../seen_instances.js' */

const LAND_ORDER = 900;

/** @typedef {typeof import('../three.js')} Three the library three.js */
/** @typedef {{x: number, y: number, z: number}} Point from the local origin [m] */

/**
 * @typedef {object} RoadWorld
 * @property {Group} group for the scene of three.js: z up, metres from `localOrigin(scene)`;
 *   includes the lights
 * @property {FogExp2} fog of the scene of three.js
 * @property {(environment: Environment) => void} setEnvironment shows another time of day or
 *   visibility than the scene document's
 * @property {(store: Store, now_ms: number, eye: Point) => void} update called before each
 *   picture, after `store.displayed(now_ms)`; eye is that of the main camera
 * @property {(sight: Sight) => void} see called before each camera draws, after `update`; else
 *   everything near is drawn
 * @property {(x: number, y: number) => number} heightAt of the road at a point of the map [m]
 * @property {(fine: boolean) => void} setFine see Detail
 * @property {number} triangles in the whole group, at most
 * @property {number} drawCalls at most, if all of it is visible
 * @property {number} build_ms build time
 * @property {() => void} dispose frees the memory of the graphics card
 */

/**
 * Build the world of a scene.
 *
 * @param {Three} three the library
 * @param {Scene} scene the scene document
 * @returns {RoadWorld}
 */
export function createRoadWorld(three, scene) {
  const begin_ms = performance.now();
  const origin = localOrigin(scene);
  const index = new RoadIndex(scene.lanelets);
  /** @type {(x: number, y: number) => number} */
  const heightAt = (x, y) => index.heightAt(x, y);
  const group = new three.Group();
  const atmosphere = new Atmosphere(three);
  atmosphere.set(scene.environment);
  const grain = grainTexture(three);
  const material = paintedMaterial(three, grain);
  const roads = buildRoads(scene, origin, index, heightAt, triangulator(three));
  const land = buildLand(scene, origin);
  /** @type {(parts: MeshParts) => Mesh} */
  const meshOf = (parts) => {
    const mesh = new three.Mesh(geometryOf(three, parts), material);
    mesh.matrixAutoUpdate = false;
    return mesh;
  };
  const [tiles, plainTiles] = [land.tiles, land.plain].map((parts) => parts.map(meshOf));
  for (const mesh of [...tiles, ...plainTiles]) {
    // Drawn after the roads, so that the land under them is not computed.
    mesh.renderOrder = LAND_ORDER;
  }
  plainTiles.forEach((mesh) => { mesh.visible = false; });
  const meshes = [...tiles, ...roads.map(meshOf)];
  const painted = paintedMaterial(three, null);
  const scenery = new Scenery(three, placeRoadside(scene, index), origin, land.heightAt, painted);
  const signs = new Signs(three, placeSigns(scene, index), scene.country, origin, heightAt,
    painted);
  const lights = new TrafficLights(three, placeLights(scene, index), origin, heightAt, painted);
  const obstacles = new Obstacles(three, origin, heightAt, painted);
  const standing = [scenery, signs, lights];
  /** @type {Object3D[]} */
  const all = [...meshes, ...plainTiles, ...scenery.meshes, ...signs.meshes, ...lights.meshes,
    obstacles.mesh];
  group.add(atmosphere.group, ...all);
  return {
    group, fog: atmosphere.fog, heightAt,
    setEnvironment: (environment) => atmosphere.set(environment),
    update(store, _now_ms, eye) {
      scenery.update(eye);
      signs.update(eye);
      lights.update(store.signals.states, eye);
      obstacles.update(store.perceived.occupancy);
    },
    see(sight) {
      standing.forEach((part) => part.see(sight));
    },
    setFine(fine) {
      atmosphere.setFine(fine);
      plainTiles.forEach((mesh) => { mesh.visible = !fine; });
      tiles.forEach((mesh) => { mesh.visible = fine || plainTiles.length === 0; });
      const anisotropy = fine ? GRAIN_ANISOTROPY : 1;
      if (grain.anisotropy !== anisotropy) {
        grain.anisotropy = anisotropy;
        grain.needsUpdate = true;
      }
    },
    triangles: meshes.reduce((sum, { geometry }) => sum + (geometry.index?.count ?? 0) / 3,
      standing.reduce((sum, part) => sum + part.triangles, atmosphere.triangles)),
    drawCalls: all.length - plainTiles.length + 1,
    build_ms: performance.now() - begin_ms,
    dispose() {
      atmosphere.dispose();
      standing.forEach((part) => part.dispose());
      obstacles.dispose();
      painted.dispose();
      [...meshes, ...plainTiles].forEach(({ geometry }) => geometry.dispose());
      material.dispose();
      grain.dispose();
    },
  };
}

/**
 * @param {Three} three
 * @returns {(ring: number[]) => number[]} returns three indices for each triangle of a polygon
 */
function triangulator(three) {
  return (ring) => {
    const corners = [];
    for (let i = 0; i < ring.length; i += 2) {
      // Relative to its first point, because large coordinates cause cancellation.
      corners.push(new three.Vector2(ring[i] - ring[0], ring[i + 1] - ring[1]));
    }
    return three.ShapeUtils.triangulateShape(corners, []).flat();
  };
}
