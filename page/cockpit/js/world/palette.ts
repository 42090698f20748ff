// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The colours of the theme in force, read from the style sheets' custom properties. */

const NAMES = [
  'human', 'av', 'recorded', 'vulnerable', 'static', 'traffic', 'scripted', 'alarm', 'accent',
  'map-ground', 'map-grid', 'map-road', 'map-junction', 'map-walk', 'map-cycle', 'map-parking',
  'map-kerb', 'map-mark', 'map-seam', 'map-arrow', 'map-stop', 'map-outline', 'map-glass',
  'map-lamp', 'map-brake', 'map-indicator', 'map-blue', 'map-shadow', 'map-label',
  'map-label-ground', 'map-overlay', 'map-ray', 'map-estimate', 'map-occupied',
] as const;

/** Return the name of a vehicle's or object's colour: that of its driver, else of its kind. */
export function colorNameOf({ role, type }: { role: string; type: string }): ColorName {
  return role === 'human' ? role : role === 'autonomous' ? 'av'
    : type === 'pedestrian' || type === 'bicycle' ? 'vulnerable'
      : role === 'traffic' || role === 'scripted' || role === 'static' ? role : 'recorded';
}

/**
 * Resolve a custom property to a colour for canvas and plots.
 * @param name without the leading dashes
 * @returns a CSS colour without variables
 */
export function themeColor(name: string): string {
  const probe = document.createElement('span');
  // Else all colours would be equal if the system forces its own colours.
  probe.style.forcedColorAdjust = 'none';
  probe.style.color = `var(--${name})`;
  document.documentElement.append(probe);
  const color = getComputedStyle(probe).color;
  probe.remove();
  return color;
}

/**
 * Call a function at each change of the system's theme or of data-theme on <html>.
 * @param changed called after the new colours are in force
 */
export function onThemeChange(changed: () => void) {
  const observer = new MutationObserver(changed);
  observer.observe(document.documentElement, { attributeFilter: ['data-theme', 'class'] });
  const query = window.matchMedia('(prefers-color-scheme: dark)');
  query.addEventListener('change', changed);
}

/** `map-label-ground` -> `labelGround` */
export type Camel<Name extends string> = Name extends `map-${infer Rest}` ? Camel<Rest>
  : Name extends `${infer Word}-${infer More}` ? `${Word}${Capitalize<Camel<More>>}` : Name;

export type ColorName = Camel<typeof NAMES[number]>;
export type Colors = Palette & Record<ColorName, string>;

/** Colours by name, 'map-' left out: palette.human, palette.road, palette.labelGround, … */
export class Palette {
  rem_px;

  constructor() {
    this.rem_px = 16;
    this.read();
  }

  /** Return a palette with the current colours. */
  static ofTheme(): Colors {
    return new Palette() as Colors;
  }

  /** Read all colours, and the root's font size. */
  read() {
    for (const name of NAMES) {
      const key = name.replace('map-', '').replace(/-(\w)/g, (_, letter) => letter.toUpperCase());
      Object.assign(this, { [key]: themeColor(name) });
    }
    this.rem_px = parseFloat(getComputedStyle(document.documentElement).fontSize);
  }
}
