// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Functions that build and update page elements; text is only set as text, never as mark-up. */

const SVG = 'http://www.w3.org/2000/svg';

export type Listeners = {
  [Name in keyof HTMLElementEventMap]?: (event: HTMLElementEventMap[Name]) => void
};
export type Attributes = { text?: string; on?: Listeners }
  & { [name: string]: string | number | boolean | null | undefined | Listeners };

/**
 * Make an HTML element.
 * @param tag name of the element.
 * @param attributes `class`, `text`, `on` (listeners by event name) and attributes; true gives an
 *   empty attribute, false, null and undefined none.
 */
export function element<Tag extends keyof HTMLElementTagNameMap>(tag: Tag,
  attributes: Attributes = {}, ...children: (Node | string | null)[]): HTMLElementTagNameMap[Tag] {
  return fill(document.createElement(tag), attributes, children);
}

/** Make an SVG element; the parameters are those of `element`. */
export function svg<Tag extends keyof SVGElementTagNameMap>(tag: Tag, attributes: Attributes = {},
  ...children: (Node | string | null)[]): SVGElementTagNameMap[Tag] {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

function fill<Filled extends Element>(node: Filled, { text, on, ...attributes }: Attributes,
  children: (Node | string | null)[]): Filled {
  if (text !== undefined) {
    node.textContent = text;
  }
  for (const [event, listener] of Object.entries(on ?? {})) {
    node.addEventListener(event, listener as EventListener);
  }
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== false && value !== null && value !== undefined) {
      node.setAttribute(name, value === true ? '' : String(value));
    }
  }
  node.append(...children.filter((child) => child !== null));
  return node;
}

/**
 * Find the element with an id in, or at, a root.
 * @throws {Error} if the page has none.
 */
export function part(root: HTMLElement, id: string): HTMLElement {
  const found: HTMLElement | null = root.id === id ? root
    : root.querySelector(`#${id}`) ?? document.getElementById(id);
  if (!found) {
    throw new Error(`the page has no element #${id}`);
  }
  return found;
}

/** Call a function in every animation frame from the next on, with the frame's time [ms]. */
export function inEveryFrame(draw: (now_ms: number) => void) {
  requestAnimationFrame((now_ms) => {
    inEveryFrame(draw);
    draw(now_ms);
  });
}

/** Write text only when it changed, because every write costs a layout. */
export function setText(node: Element, text: string) {
  if (node.textContent !== text) {
    node.textContent = text;
  }
}

/**
 * Set or remove an attribute only when it changed.
 * @param value true gives an empty attribute, false and null remove it.
 */
export function setAttribute(node: Element, name: string, value: string | boolean | null) {
  const text = value === true ? '' : value === false ? null : value;
  if (node.getAttribute(name) === text) {
    return;
  }
  if (text === null) {
    node.removeAttribute(name);
  } else {
    node.setAttribute(name, text);
  }
}
