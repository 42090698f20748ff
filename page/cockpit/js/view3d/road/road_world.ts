// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The surroundings in the 3D view: roads, roadside objects, land and sky. */

import { localOrigin } from '../local_origin.js';
import { Atmosphere } from './atmosphere.js';
import { buildLand } from './land.js';
import { geometryOf, GRAIN_ANISOTROPY, grainTexture, paintedMaterial } from './materials.js';
import { Obstacles } from './obstacles.js';
import { placeLights, placeSigns } from './poles.js';
import { buildRoads } from './road_chunks.js';
import { RoadIndex } from './road_index.js';
import { placeRoadside } from './roadside.js';
import { Scenery } from './scenery_shapes.js';
import { Signs } from './signs.js';
import { TrafficLights } from './traffic_lights.js';

import type { FogExp2, Group, Mesh, Object3D } from 'three';
import type { Environment, Scene } from '../../messages.js';
import type { Store } from '../../store.js';
import type { Named } from '../contents.js';
import type { Sight } from '../seen_instances.js';
import type { Three } from '../three.js';
import type { MeshParts } from './mesh_parts.js';

const LAND_ORDER = 900;

export interface Point { x: number; y: number; z: number } // from the local origin [m]

export interface RoadWorld {
  // for the scene of three.js: z up, metres from `localOrigin(scene)`; includes the lights
  group: Group;
  fog: FogExp2; // of the scene of three.js
  // shows another time of day or visibility than the scene document's
  setEnvironment: (environment: Environment) => void;
  // called before each picture, after `store.displayed(now_ms)`; eye is that of the main camera
  update: (store: Store, eye: Point) => void;
  // called before each camera draws, after `update`; else everything near is drawn
  see: (sight: Sight) => void;
  heightAt: (x: number, y: number) => number; // of the road at a point of the map [m]
  setFine: (fine: boolean) => void; // see Detail
  solids: Named[]; // signs and traffic lights
  triangles: number; // in the whole group, at most
  drawCalls: number; // at most, if all of it is visible
  dispose: () => void; // frees the memory of the graphics card
}

/** Build the world of a scene. */
export function createRoadWorld(three: Three, scene: Scene): RoadWorld {
  const origin = localOrigin(scene);
  const index = new RoadIndex(scene.lanelets);
  const heightAt = (x: number, y: number): number => index.heightAt(x, y);
  const group = new three.Group();
  const atmosphere = new Atmosphere(three);
  atmosphere.set(scene.environment);
  const grain = grainTexture(three);
  const material = paintedMaterial(three, grain);
  const roads = buildRoads(scene, origin, index, heightAt, triangulator(three));
  const land = buildLand(scene, origin);
  const meshOf = (parts: MeshParts): Mesh => {
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
  const all: Object3D[] = [...meshes, ...plainTiles, ...scenery.meshes, ...signs.meshes,
    ...lights.meshes, obstacles.mesh];
  group.add(atmosphere.group, ...all);
  return {
    group, fog: atmosphere.fog, heightAt, solids: [...signs.solids, ...lights.solids],
    setEnvironment: (environment) => atmosphere.set(environment),
    update(store, eye) {
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

/** @returns returns three indices for each triangle of a polygon */
function triangulator(three: Three): (ring: number[]) => number[] {
  return (ring) => {
    const corners = [];
    for (let i = 0; i < ring.length; i += 2) {
      // Relative to its first point, because large coordinates cause cancellation.
      corners.push(new three.Vector2(ring[i] - ring[0], ring[i + 1] - ring[1]));
    }
    return three.ShapeUtils.triangulateShape(corners, []).flat();
  };
}
