// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The settings in the address of a stage, the page for a driver. */

import { VIEWPOINTS } from '../view3d/cameras.js';
import { FIELD_OF_VIEW } from '../view3d/field_of_view.js';

/** @import { StageView } from './stage_messages.js' */

/**
 * @typedef {object} StageAddress
 * @property {string} seat id of the vehicle that is driven
 * @property {StageView} view at first
 * @property {boolean} map whether the small map lies over a 3D view
 * @property {boolean} names whether vehicles are named
 * @property {boolean} plans whether plans, perception and goals of AVs are shown
 * @property {boolean} sound whether there is sound, if the game has any
 * @property {boolean} mirrors whether the driver has them
 * @property {boolean} change whether V and C change the view
 * @property {number|null} fieldOfView_deg across the picture; null for the browser's own [deg]
 * @property {'en'|'de'} lang of the texts of the stage
 */

/**
 * Read a page's address.
 *
 * @param {string} query `?stage=hv0&view=driver&map=1&names=0&plans=0&sound=1&lang=en`
 * @returns {StageAddress|null} null for the full page
 */
export function readStage(query) {
  const values = new URLSearchParams(query);
  const seat = values.get('stage');
  if (seat === null) {
    return null;
  }
  /** @type {(name: string, usual: boolean) => boolean} */
  const flag = (name, usual) => (usual ? values.get(name) !== '0' : values.get(name) === '1');
  const angle = Number(values.get('fov') ?? NaN);
  return {
    seat, view: [...VIEWPOINTS, /** @type {const} */ ('map')].find(
      (name) => name === values.get('view')) ?? 'driver',
    map: flag('map', true), names: flag('names', false), plans: flag('plans', false),
    sound: flag('sound', true), mirrors: flag('mirrors', true), change: flag('change', false),
    fieldOfView_deg: angle >= FIELD_OF_VIEW.least && angle <= FIELD_OF_VIEW.most ? angle : null,
    lang: values.get('lang') === 'de' ? 'de' : 'en',
  };
}
