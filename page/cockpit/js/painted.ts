// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** The time at which an animation frame has been painted. */

/**
 * Wait until the present animation frame has been painted: the browser runs a message that is sent
 * in a frame after it has painted that frame.
 * @returns when, by performance.now
 */
export function painted(): Promise<number> {
  return new Promise((resolve) => {
    const channel = new MessageChannel();
    channel.port1.onmessage = () => {
      resolve(performance.now());
      channel.port1.close();
    };
    channel.port2.postMessage(null);
  });
}
