// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Functions that build and update page elements; text is only set as text, never as mark-up. */

const SVG = 'http://www.w3.org/2000/svg';

/**
 * @typedef {{[Name in keyof HTMLElementEventMap]?: (event: HTMLElementEventMap[Name]) => void}
 *   } Listeners
 * @typedef {{text?: string, on?: Listeners}
 *   & {[name: string]: string|number|boolean|null|undefined|Listeners}} Attributes
 */

/**
 * Make an HTML element.
 *
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag name of the element.
 * @param {Attributes} [attributes] `class`, `text`, `on` (listeners by event name) and
 *   attributes; true gives an empty attribute, false, null and undefined none.
 * @param {...(Node|string|null)} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function element(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/**
 * Make an SVG element; the parameters are those of `element`.
 *
 * @template {keyof SVGElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Attributes} [attributes]
 * @param {...(Node|string|null)} children
 * @returns {SVGElementTagNameMap[Tag]}
 */
export function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

/**
 * @template {Element} Filled
 * @param {Filled} node
 * @param {Attributes} attributes
 * @param {(Node|string|null)[]} children
 * @returns {Filled}
 */
function fill(node, { text, on, ...attributes }, children) {
  if (text !== undefined) {
    node.textContent = text;
  }
  for (const [event, listener] of Object.entries(on ?? {})) {
    node.addEventListener(event, /** @type {EventListener} */ (listener));
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
 *
 * @param {HTMLElement} root
 * @param {string} id
 * @returns {HTMLElement}
 * @throws {Error} if the page has none.
 */
export function part(root, id) {
  /** @type {HTMLElement|null} */
  const found = root.id === id ? root
    : root.querySelector(`#${id}`) ?? document.getElementById(id);
  if (!found) {
    throw new Error(`the page has no element #${id}`);
  }
  return found;
}

/**
 * Write text only when it changed, because every write costs a layout.
 *
 * @param {Element} node
 * @param {string} text
 */
export function setText(node, text) {
  if (node.textContent !== text) {
    node.textContent = text;
  }
}

/**
 * Set or remove an attribute only when it changed.
 *
 * @param {Element} node
 * @param {string} name
 * @param {string|boolean|null} value true gives an empty attribute, false and null remove it.
 */
export function setAttribute(node, name, value) {
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
