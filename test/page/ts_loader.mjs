// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Lets Node import the page's TypeScript: `node --import ./ts_loader.mjs`. */

import { register } from 'node:module';

register('./ts_hooks.mjs', import.meta.url);
