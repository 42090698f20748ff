// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Line icons on a 24 x 24 grid; they take the colour of the text around them. */

import { svg } from '../dom.js';

// Every alarm has its own silhouette, so that none depends on its colour alone.
const PATHS: Record<string, string> = {
  collision: 'M12 1.5l2.6 5.4 5.7-2-2 5.7 4.2 2.9-5 2.1 1 5.9-5.6-2.2-3.6 4.2-1.9-5.6-5.9.6'
    + ' 3.3-4.9L2 9.6l5.9-.9zM9.5 9.5l5 5M14.5 9.5l-5 5',
  off_road: 'M3 22L8 2M21 22L16 2M12 3v3M12 10v3M15.5 15l5.5 5M21 15l-5.5 5',
  stale_plan: 'M3 20C7 20 7 12 11 12M14 12.2l1.5.4M18 14l1 1.2M19 3l2 2-2 2M12 5h2M7 5h2M16 5h5',
  lost_device: 'M9 2v5M15 2v5M6 7h12v4a6 6 0 0 1-12 0zM12 17v5M2 2l20 20',
  recording: 'M12 4a8 8 0 1 0 .01 0zM6.5 17.5l11-11',
  late: 'M6 2h12M6 22h12M7 2c0 6 10 6 10 10s-10 4-10 10M17 2c0 6-10 6-10 10s10 4 10 10',
  late_traffic: 'M2 15v-4l3-5h7l3 5v4zM5 15.5a1.5 1.5 0 1 0 .01 0zM12 15.5a1.5 1.5 0 1 0 .01 0z'
    + 'M19 4v7l3 2M19 18v.01',
  connection: 'M2 8a15 15 0 0 1 20 0M5.5 12a10 10 0 0 1 5-2.6M18.5 12a10 10 0 0 0-2-1.5'
    + 'M9 15.7a5 5 0 0 1 6 0M12 19.5v.01M3 3l18 18',
  info: 'M12 3a9 9 0 1 0 .01 0zM12 11v6M12 7.2v.01',
  warn: 'M12 3L2 21h20zM12 10v5M12 18v.01',
  error: 'M8 2h8l6 6v8l-6 6H8l-6-6V8zM12 7v6M12 16.5v.01',
  close: 'M5 5l14 14M19 5L5 19',
  check: 'M4 12.5l5.5 5.5L20 6.5',
  sun: 'M12 8a4 4 0 1 0 .01 0zM12 2v2M12 20v2M2 12h2M20 12h2M5 5l1.4 1.4M17.6 17.6L19 19'
    + 'M5 19l1.4-1.4M17.6 6.4L19 5',
  moon: 'M20 14.5A8.5 8.5 0 1 1 9.5 4a7 7 0 0 0 10.5 10.5z',
  auto: 'M12 3a9 9 0 1 0 .01 0zM12 3v18M12 7h4.5M12 11h6.8M12 15h5.4M12 19h2.5',
  panel: 'M3 4h18v16H3zM15 4v16',
  upload: 'M12 16V4M7 9l5-5 5 5M4 15v5h16v-5',
  sound: 'M3 9h4l5-5v16l-5-5H3zM15.5 8.5a5 5 0 0 1 0 7M18 5.5a9 9 0 0 1 0 13',
  sound_off: 'M3 9h4l5-5v16l-5-5H3zM16 9l6 6M22 9l-6 6',
  stop: 'M6 6h12v12H6z',
  go: 'M7 4.5v15l12-7.5z',
  pause: 'M8 5v14M16 5v14',
  bin: 'M4 7h16M9 7V4h6v3M6 7l1 13h10l1-13M10 11v5M14 11v5',
  download: 'M12 4v12M7 11l5 5 5-5M4 17v3h16v-3',
  full: 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5',
  speech: 'M4 5h16v11h-9l-4 4v-4H4zM8 9h8M8 12h5',
  bolt: 'M13 2L4 14h7l-1 8 9-12h-7z',
  clock: 'M12 3a9 9 0 1 0 .01 0zM12 7v5l3.5 2',
};

/** Make an icon, a decoration hidden from screen readers; `name`: one of PATHS. */
export function icon(name: string): SVGElement {
  return svg('svg', {
    viewBox: '0 0 24 24', class: `line-icon line-icon-${name}`, 'aria-hidden': 'true',
  }, svg('path', { d: PATHS[name] ?? PATHS.info }));
}
