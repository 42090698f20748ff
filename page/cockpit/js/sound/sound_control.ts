// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The sound's button in the header, and the small panel that it opens. */

import { element, setAttribute, setText } from '../dom.js';
import { icon } from '../panels/icons.js';

import type { Amount, Sound } from './sound.js';

/** Make the control, which `show` updates; `root` of the button. */
export function createSoundControl(root: HTMLElement, sound: Sound): { show: () => void } {
  const button = element('button', {
    type: 'button', id: 'sound', class: 'icon-button', popovertarget: 'sound-panel',
    'aria-keyshortcuts': 'M',
  });
  const toggle = element('button', {
    type: 'button', class: 'drive-button', on: { click: () => sound.toggle() },
  });
  const told = element('p', { class: 'sound-note', role: 'status' });
  const volume = slider(sound, 'volume', 'Volume');
  const rumble = slider(sound, 'rumble', 'Rumble');
  const motors = element('p', { class: 'sound-note' });
  const panel = element('div',
    { id: 'sound-panel', popover: 'auto', role: 'group', 'aria-label': 'Sound' },
    toggle, told, volume.node, rumble.node, motors);
  let picture = '';
  const show = () => {
    const state = stateOf(sound);
    if (state.icon !== picture) {
      picture = state.icon;
      button.replaceChildren(icon(picture));
    }
    setAttribute(button, 'title', state.title);
    setAttribute(button, 'aria-label', state.title);
    setText(toggle, sound.wanted ? 'Turn sound off' : 'Turn sound on');
    setAttribute(toggle, 'disabled', !sound.allowed);
    setText(told, state.note);
    volume.show();
    rumble.show();
    setText(motors, sound.canRumble ? 'Felt in the gamepad while you drive.'
      : 'No gamepad that can vibrate was found: press one of its buttons.');
  };
  panel.addEventListener('beforetoggle', show);
  root.prepend(button);
  document.body.append(panel);
  return { show };
}

function stateOf({ allowed, wanted, on }: Sound) {
  if (!allowed) {
    return { icon: 'sound_off', title: 'Sound: this game has none',
      note: 'This game is played without sound and rumble.' };
  }
  if (on) {
    return { icon: 'sound', title: 'Sound: on (M turns it off)',
      note: 'What the driver of your vehicle hears, or of the one you follow.' };
  }
  return { icon: 'sound_off',
    title: wanted ? 'Sound: begins with your next click or key' : 'Sound: off (M turns it on)',
    note: 'Browsers let a page sound only after a click or a key.' };
}

/** @param name readable name */
function slider(sound: Sound, amount: Amount, name: string) {
  const text = element('span');
  const input = element('input', { type: 'range', min: 0, max: 100, step: 5 });
  const show = () => {
    const percent = Math.round(100 * sound[amount]);
    input.value = String(percent);
    setText(text, `${name} ${percent} %`);
  };
  input.addEventListener('input', () => {
    sound.set(amount, Number(input.value) / 100);
    show();
  });
  // A focused slider would take the driving keys.
  input.addEventListener('pointerup', () => input.blur());
  return { node: element('label', { class: 'sound-slider' }, text, input), show };
}
