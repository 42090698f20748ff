// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** What a page keeps in the browser: its preferences, and what identifies it; nothing of a run. */

const PREFIX = 'crgame.';

/** A storage of the browser; where it is forbidden or full, it lasts as long as the page. */
class Memory {
  #name;
  #spare = new Map<string, string>();

  constructor(name: 'localStorage' | 'sessionStorage') {
    this.#name = name;
  }

  /** @returns null if nothing is kept */
  get(key: string): string | null {
    return this.#spare.get(key) ?? this.#try((storage) => storage.getItem(key)) ?? null;
  }

  set(key: string, value: string) {
    if (this.#try((storage) => {
      storage.setItem(key, value);
      return true;
    })) {
      this.#spare.delete(key);
    } else {
      this.#spare.set(key, value);
    }
  }

  remove(key: string) {
    this.#spare.delete(key);
    this.#try((storage) => storage.removeItem(key));
  }

  /** @returns the names that begin with a prefix */
  keys(prefix: string): string[] {
    const kept = [...this.#try((storage) => Object.keys(storage)) ?? [], ...this.#spare.keys()];
    return kept.filter((key) => key.startsWith(prefix));
  }

  #try<T>(use: (storage: Storage) => T): T | undefined {
    try {
      // Where storage is forbidden, its name alone throws.
      return use(window[this.#name]);
    } catch {
      return undefined;
    }
  }
}

/** Kept between visits. */
export const local = new Memory('localStorage');
/** Kept as long as the tab lives. */
export const session = new Memory('sessionStorage');

/** Make a key: 128 random bits; randomUUID exists on secure origins only. */
export function newKey(): string {
  return [...crypto.getRandomValues(new Uint8Array(16))]
    .map((byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** Return whether a text is a key. */
export function isKey(text: string): boolean {
  return /^[0-9a-f]{32}$/.test(text);
}

/** Return the value of a preference, empty if none was kept. */
export function recall(name: string): string {
  return local.get(PREFIX + name) ?? '';
}

/** Keep the value of a preference; an empty one forgets it. */
export function remember(name: string, value: string) {
  if (value === '') {
    local.remove(PREFIX + name);
  } else {
    local.set(PREFIX + name, value);
  }
}
