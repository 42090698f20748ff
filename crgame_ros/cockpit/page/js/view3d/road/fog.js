// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** How fog takes contrast away (Koschmieder), as a number and as three.js draws it. */

/** @import { FogExp2 } from 'three' */
/** @typedef {typeof import('../three.js')} Three */

/**
 * Give what air takes of a contrast: at the meteorological visibility 5 % of it is left, for which
 * 3 stands in place of -ln 0.05 = 2.996, as is usual.
 *
 * @param {number} visibility meteorological [m]
 * @returns {number} extinction coefficient [1/m]
 */
export function extinction(visibility) {
  return 3 / visibility;
}

/**
 * Return the share of a contrast that is left.
 *
 * @param {number} distance [m]
 * @param {number} visibility meteorological [m]
 */
export function contrastLeft(distance, visibility) {
  return Math.exp(-extinction(visibility) * distance);
}

// three.js fogs by exp(-(density * depth)^2), along the view's axis and between colours as they
// are encoded for the screen; air does by exp(-density * distance), between lights.
// Light is fogged before it is encoded: encoding is the dearest part of a pixel that a processor
// draws, and is done once.
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

/**
 * Let every material of the library be fogged as air does; before the first picture is drawn.
 *
 * @param {Three} three the library
 */
export function fogAsAirDoes(three) {
  three.ShaderChunk.fog_pars_vertex = DECLARED;
  three.ShaderChunk.fog_vertex = VERTEX;
  three.ShaderChunk.fog_pars_fragment = UNIFORMS;
  three.ShaderChunk.fog_fragment = FRAGMENT;
  three.ShaderChunk.colorspace_fragment = ENCODING;
}

/**
 * Make the fog of a scene: materials get its light, where the library would give them the colour
 * as encoded for the screen.
 *
 * @param {Three} three the library
 * @returns {FogExp2} of no density
 */
export function airFog(three) {
  const fog = new three.FogExp2(0xffffff, 0);
  fog.color.getRGB = function getLight(target) {
    return Object.assign(target, { r: this.r, g: this.g, b: this.b });
  };
  return fog;
}
