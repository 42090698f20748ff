// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The loss of contrast in fog (Koschmieder), as a number and for three.js. */

import type { FogExp2 } from 'three';
import type { Three } from '../three.js';

/**
 * Return the extinction of air: at the meteorological visibility 5 % of a contrast is left. As
 * usual, 3 replaces -ln 0.05 = 2.996.
 * @param visibility meteorological [m]
 * @returns extinction coefficient [1/m]
 */
export function extinction(visibility: number): number {
  return 3 / visibility;
}

/**
 * Return the share of a contrast that is left.
 * @param distance [m]
 * @param visibility meteorological [m]
 */
export function contrastLeft(distance: number, visibility: number) {
  return Math.exp(-extinction(visibility) * distance);
}

// three.js fogs by exp(-(density * depth)^2), along the view's axis and between colours encoded
// for the screen. Air attenuates by exp(-density * distance), in linear light.
// Fog is applied before encoding, because encoding is the most expensive part of a pixel on a
// processor, and is then done once.
const DECLARED = `#ifdef USE_FOG
  varying vec3 vFromEye;
#endif`;
const VERTEX = `#ifdef USE_FOG
  vFromEye = mvPosition.xyz;
#endif`;
const ENCODING = `#ifndef USE_FOG
  gl_FragColor = linearToOutputTexel( gl_FragColor );
#endif`;
const UNIFORMS = `#ifdef USE_FOG
  uniform vec3 fogColor;
  varying vec3 vFromEye;
  #ifdef FOG_EXP2
    uniform float fogDensity;
  #else
    uniform float fogNear;
    uniform float fogFar;
  #endif
#endif`;
const FRAGMENT = `#ifdef USE_FOG
  float fogDepth = length( vFromEye );
  #ifdef FOG_EXP2
    float fogFactor = 1.0 - exp( - fogDensity * fogDepth );
  #else
    float fogFactor = smoothstep( fogNear, fogFar, fogDepth );
  #endif
  gl_FragColor.rgb = mix( gl_FragColor.rgb, fogColor, fogFactor );
  gl_FragColor = linearToOutputTexel( gl_FragColor );
#endif`;

/** Change the fog of all the library's materials to that of air; call before the first picture. */
export function fogAsAirDoes(three: Three) {
  three.ShaderChunk.fog_pars_vertex = DECLARED;
  three.ShaderChunk.fog_vertex = VERTEX;
  three.ShaderChunk.fog_pars_fragment = UNIFORMS;
  three.ShaderChunk.fog_fragment = FRAGMENT;
  three.ShaderChunk.colorspace_fragment = ENCODING;
}

/**
 * Make the fog of a scene. Materials get its linear light, where the library would pass the colour
 * encoded for the screen.
 * @returns of no density
 */
export function airFog(three: Three): FogExp2 {
  const fog = new three.FogExp2(0xffffff, 0);
  fog.color.getRGB = function getLight(target) {
    return Object.assign(target, { r: this.r, g: this.g, b: this.b });
  };
  return fog;
}
