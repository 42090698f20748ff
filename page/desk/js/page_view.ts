// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** A page to read, made of Markdown elements only. */

import { element } from '../../cockpit/js/dom.js';

import type { PageDocument, PageNode } from './desk_messages.js';
import type { Words } from './words.js';

const TAGS = ['h1', 'h2', 'h3', 'h4', 'h5', 'h6', 'p', 'ul', 'ol', 'li',
  'blockquote', 'hr', 'em', 'strong', 's', 'table', 'thead', 'tbody', 'tr', 'th', 'td', 'br',
  'code', 'pre', 'span'] as const;

/** Build the nodes of a page. */
export function pageNodes(tree: PageNode[]): Node[] {
  return tree.map((node) => {
    if (typeof node === 'string') {
      return document.createTextNode(node);
    }
    const children = pageNodes(node.children ?? []);
    if (node.tag === 'a') {
      return element('a', { href: node.href, target: '_blank', rel: 'noopener noreferrer' },
        ...children);
    }
    if (node.tag === 'img') {
      return element('img', { src: `/picture/${encodeURI(node.src ?? '')}`, alt: node.alt });
    }
    const tag = TAGS.find((known) => known === node.tag) ?? 'span';
    return element(tag, {}, ...children);
  });
}

/** Build a page with its button to continue. */
export function pageView({ tree, consent }: PageDocument, words: Words,
  finish: (agreed?: boolean) => void): HTMLElement {
  const article = element('article', { class: 'reading' }, ...pageNodes(tree));
  const buttons = element('div', { class: 'go-on' });
  const copy = element('p', {}, element('a', { class: 'copy', href: '/consent', download: '',
    text: words.of('copy') }));
  if (!consent) {
    buttons.append(button(words.of('next'), 'primary', () => finish()));
    return element('div', {}, article, buttons);
  }
  const ask = () => {
    const back = button(words.of('back'), '', show);
    buttons.replaceChildren(
      element('p', { class: 'problem', role: 'alert', text: words.of('disagree_sure') }),
      back, button(words.of('disagree_yes'), 'danger', () => finish(false)));
    back.focus();
  };
  const show = () => buttons.replaceChildren(
    button(words.of('disagree'), '', ask),
    button(words.of('agree'), 'primary', () => finish(true)));
  show();
  return element('div', {}, article, copy, buttons);
}

export function button(text: string, kind: string, act: () => void) {
  return element('button', { type: 'button', class: kind || null, text, on: { click: act } });
}
