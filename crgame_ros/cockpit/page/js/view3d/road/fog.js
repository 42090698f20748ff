// Copyright 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** How fog takes contrast away (Koschmieder), as a number and as three.js draws it. */

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
 * Give the share of a contrast that is left.
 *
 * @param {number} distance [m]
 * @param {number} visibility meteorological [m]
 */
export function contrastLeft(distance, visibility) {
  return Math.exp(-extinction(visibility) * distance);
}

// three.js fogs by exp(-(density * depth)^2), along the view's axis and between colours as they
// are encoded for the screen; air does by exp(-density * distance), between lights.
const DECLARED = `#ifdef USE_FOG
  varying vec3 vFromEye;
#endif`;
const VERTEX = `#ifdef USE_FOG
  vFromEye = mvPosition.xyz;
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
  // A mirror's picture is not encoded, the screen's is.
  if ( linearToOutputTexel( vec4( 0.5 ) ).r > 0.6 ) {
    vec3 seenLight = mix( sRGBTransferEOTF( vec4( gl_FragColor.rgb, 1.0 ) ).rgb,
      sRGBTransferEOTF( vec4( fogColor, 1.0 ) ).rgb, fogFactor );
    gl_FragColor.rgb = sRGBTransferOETF( vec4( seenLight, 1.0 ) ).rgb;
  } else {
    gl_FragColor.rgb = mix( gl_FragColor.rgb, fogColor, fogFactor );
  }
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
}
