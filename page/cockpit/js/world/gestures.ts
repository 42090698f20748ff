// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Mouse, pen and fingers on the canvas: drag, wheel, right or shift drag, pinch, double click. */

const WHEEL_ZOOM = 0.0015;
const LINE_PX = 30;
// A click moves less than this [px].
const CLICK_PX = 4;

/** The actions of gestures, in CSS pixels and rad, counter-clockwise on the screen. */
export interface Actions {
  pan: (dx: number, dy: number) => void;
  zoom: (factor: number, x: number, y: number) => void;
  rotate: (angle: number, x?: number, y?: number) => void;
  pick: (x: number, y: number) => void; // a double click
}

export interface Place { x: number; y: number } // on the canvas [px]
export interface Hand extends Place { moved: number }

/** Make pointers move a camera; `canvas` receives the pointers. */
export function attachGestures(canvas: HTMLCanvasElement, actions: Actions) {
  const hands = new Map<number, Hand>();
  let turning = false;

  const place = (event: MouseEvent) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };

  canvas.addEventListener('contextmenu', (event) => event.preventDefault());

  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    hands.set(event.pointerId, { ...place(event), moved: 0 });
    turning = event.button === 2 || event.shiftKey;
    canvas.classList.add('dragging');
  });

  canvas.addEventListener('pointermove', (event) => {
    const hand = hands.get(event.pointerId);
    if (hand === undefined) {
      return;
    }
    const now = place(event);
    hand.moved += Math.hypot(now.x - hand.x, now.y - hand.y);
    if (hands.size === 1 && hand.moved >= CLICK_PX) {
      if (turning) {
        const box = canvas.getBoundingClientRect();
        actions.rotate(angleAt(box.width / 2, box.height / 2, hand, now));
      } else {
        actions.pan(now.x - hand.x, now.y - hand.y);
      }
    } else if (hands.size === 2) {
      const [other] = [...hands.values()].filter((item) => item !== hand);
      pinch(hand, other, now, actions);
    }
    hand.x = now.x;
    hand.y = now.y;
  });

  const leave = (event: PointerEvent) => {
    hands.delete(event.pointerId);
    if (hands.size === 0) {
      canvas.classList.remove('dragging');
    }
  };
  canvas.addEventListener('pointerup', leave);
  canvas.addEventListener('pointercancel', leave);

  canvas.addEventListener('dblclick', (event) => {
    const { x, y } = place(event);
    actions.pick(x, y);
  });

  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    const { x, y } = place(event);
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY
      : event.deltaY * LINE_PX;
    actions.zoom(Math.exp(-WHEEL_ZOOM * pixels), x, y);
  }, { passive: false });
}

/** `before` of the moving pointer; `other` of the resting pointer. */
function pinch(before: Place, other: Place, now: Place, actions: Actions) {
  const x = (now.x + other.x) / 2;
  const y = (now.y + other.y) / 2;
  actions.pan((now.x - before.x) / 2, (now.y - before.y) / 2);
  const was = Math.hypot(before.x - other.x, before.y - other.y);
  const is = Math.hypot(now.x - other.x, now.y - other.y);
  if (was > 1 && is > 1) {
    actions.zoom(is / was, x, y);
    actions.rotate(angleAt(other.x, other.y, before, now), x, y);
  }
}

/** Return the angle counter-clockwise on the screen, whose y points down. */
function angleAt(x: number, y: number, from: Place, to: Place) {
  const angle = Math.atan2(from.y - y, from.x - x) - Math.atan2(to.y - y, to.x - x);
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}
