// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Plots as one picture, drawn by Plotly itself. */

import { themeColor } from '../world/palette.js';
import { loadPlotly } from './plotly.js';

import type { Chart } from './chart.js';

const HEAD_PX = 26;
const WIDTH_PX = 720;
const HEIGHT_PX = 190;
const PIXELS = 2;

export interface Picture { text: string; width: number; height: number } // SVG and its size [px]

/** Draw plots below each other. */
export async function picturesOf(charts: Chart[]): Promise<Picture> {
  const library = await loadPlotly();
  const row_px = HEAD_PX + HEIGHT_PX;
  const height = row_px * charts.length;
  const rows = [];
  for (const [i, chart] of charts.entries()) {
    const { title, unit } = chart.quantity;
    const address = await library.toImage(chart.plot, {
      format: 'svg', width: WIDTH_PX, height: HEIGHT_PX });
    // Joined as text: parsed in this page, its inline styles would be refused.
    const drawn = decodeURIComponent(address.slice(address.indexOf(',') + 1));
    rows.push(`<text x="8" y="${i * row_px + 18}" fill="${themeColor('text')}" font-size="14" `
      + `font-family="sans-serif">${escaped(unit ? `${title} [${unit}]` : title)}</text>`,
    drawn.replace(/^[^]*?<svg /, `<svg y="${i * row_px + HEAD_PX}" `));
  }
  const text = `<svg xmlns="http://www.w3.org/2000/svg" width="${WIDTH_PX}" height="${height}" `
    + `viewBox="0 0 ${WIDTH_PX} ${height}"><rect width="${WIDTH_PX}" height="${height}" `
    + `fill="${themeColor('surface')}"/>${rows.join('')}</svg>`;
  return { text, width: WIDTH_PX, height };
}

function escaped(text: string) {
  return text.replaceAll('&', '&amp;').replaceAll('<', '&lt;').replaceAll('>', '&gt;');
}

/** Convert a picture to pixels; return PNG. */
export async function rasterised({ text, width, height }: Picture): Promise<Blob> {
  const address = URL.createObjectURL(new Blob([text], { type: 'image/svg+xml' }));
  try {
    const image = new Image();
    image.src = address;
    await image.decode();
    const canvas = document.createElement('canvas');
    canvas.width = PIXELS * width;
    canvas.height = PIXELS * height;
    canvas.getContext('2d')?.drawImage(image, 0, 0, canvas.width, canvas.height);
    return await new Promise((resolve, reject) => {
      canvas.toBlob((blob) => (blob === null ? reject(new Error('no picture')) : resolve(blob)));
    });
  } finally {
    URL.revokeObjectURL(address);
  }
}
