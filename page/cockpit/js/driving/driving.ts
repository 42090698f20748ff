// SPDX-FileCopyrightText: 2026 The crgame_ros authors
// SPDX-License-Identifier: Apache-2.0
/** Driving from the page: seats, inputs and instruments. */

import { part } from '../dom.js';
import { VEHICLE, VEHICLE_WIDTH } from '../frames.js';
import { Seats } from '../seats.js';
import { CalibrationDialog } from './calibration.js';
import { DevicePanel, shortName } from './device_panel.js';
import { Focus } from './focus.js';
import { Gamepads } from './gamepad.js';
import { Hud } from './hud.js';
import { Keyboard } from './keyboard.js';
import { PutBackNotice } from './put_back_notice.js';
import { describeSeat } from './seat_text.js';
import { InputSender } from './sender.js';

import type { Connection } from '../connection.js';
import type { Hands, Reply } from '../messages.js';
import type { Store } from '../store.js';

// How long the button keeps asking: a moving vehicle may free a place meanwhile [ms].
const PUT_BACK_MS = 500;

/** The driving part of a page; in `window.crgame.driving`. */
export class Driving {
  #store;
  #connection;
  #sender;
  #devicePanel: DevicePanel | null = null;
  #reverse = false;
  // After the driving device was unplugged, nothing moves before the driver moves a control.
  #unplugged = false;
  // Text of the instruments while there is no connection.
  #lost = '';
  #sentDevice = '';
  #putBackNotice;
  focus;
  keyboard;
  gamepads;
  calibration;
  hud;

  /** @param root `#hud`, or an ancestor of it */
  constructor(root: HTMLElement, store: Store, connection: Connection) {
    this.#store = store;
    this.#connection = connection;
    this.#putBackNotice = new PutBackNotice(store);
    this.focus = new Focus(store, (reason) => this.#focusChanged(reason));
    this.keyboard = new Keyboard(() => this.seat !== null && this.focus.reason === null, {
      changed: () => this.#moved(this.keyboard.anyHeld),
      reversed: () => this.#setReverse(!this.#reverse),
    });
    this.#sender = new InputSender(connection, () => {
      const { hands } = this;
      this.#putBackNotice.update(this.seat, 'put_back' in hands && hands.put_back === 1);
      return hands;
    });
    this.gamepads = new Gamepads({
      changed: () => this.#moved(this.gamepads?.active !== null),
      gear: (change) => this.#setReverse(change(this.#reverse)),
      unplugged: () => this.#unplug(),
      listed: () => {
        this.#devicePanel?.list();
        this.#sendDevice();
      },
    });
    this.calibration = new CalibrationDialog(
      (index, profile) => this.gamepads.setProfile(index, profile));
    this.#devicePanel = new DevicePanel(this.gamepads, (index) => this.calibration.open(index));
    this.hud = new Hud(part(root, 'hud'), store, () => this.#subject(),
      this.keyboard);
    store.on('seats', () => this.#updateSeat());
    store.on('hello', () => this.#sendDevice(true));
    store.on('connection', (connected) => this.#connectionChanged(connected));
    this.#updateSeat();
  }

  /** @returns the seat that this page drives */
  get seat(): string | null {
    return this.#sender?.seat ?? null;
  }

  /** @returns why the controls are released, null while they are in use */
  get away(): string | null {
    return this.focus.reason ?? (this.#unplugged ? 'unplugged' : null);
  }

  /** @returns the driver's inputs, as in an input message */
  get hands(): Hands {
    if (this.away !== null) {
      return { away: true };
    }
    const rest = {
      reverse: Number(this.#reverse),
      lights: this.keyboard.lights.map((held, i) => held | this.gamepads.lights[i]),
      put_back: Number(this.keyboard.putBack || this.gamepads.putBack),
    };
    const axes = this.keyboard.anyHeld ? null : this.gamepads.axes;
    return axes === null ? { keys: this.keyboard.keys, ...rest } : { axes, ...rest };
  }

  /** @returns the list of input devices, for the Drive panel */
  get devices(): HTMLElement {
    return (this.#devicePanel as DevicePanel).node;
  }

  /** Take a seat and give back the former one. */
  async claim(seat: string): Promise<Reply> {
    if (this.seat !== null && this.seat !== seat) {
      await this.release();
    }
    return this.#connection.request({ type: 'claim', seat, device: this.device });
  }

  /** Release the controls at once, and give the seat back. */
  async release(): Promise<Reply> {
    const { seat } = this;
    this.#leaveSeat();
    const reply = await this.#connection.request({ type: 'release', seat: seat ?? '' });
    this.#updateSeat();
    return reply;
  }

  /** Request that the vehicle is put back on its lane, as its key does. */
  putBack() {
    this.keyboard.press('Backspace');
    setTimeout(() => this.keyboard.lift('Backspace'), PUT_BACK_MS);
  }

  /** Return the input device, as the recording names it. */
  get device() {
    const active = this.gamepads?.active;
    return active ? shortName(active.id).slice(0, 60) : 'Keyboard';
  }

  /** @param anew send it even if the server has it already */
  #sendDevice(anew = false) {
    if (anew || this.device !== this.#sentDevice) {
      this.#sentDevice = this.device;
      this.#connection.send({ type: 'device', device: this.device });
    }
  }

  #connectionChanged(connected: boolean) {
    if (connected) {
      this.#lost = '';
    } else if (this.#lost === '') {
      // Called again at each failed attempt to connect.
      this.#lost = this.#store.status?.run === 'ended' ? ''
        : this.seat === null ? 'Connection lost: this is how it was last seen.'
          : `Connection lost: ${this.seat} brakes by itself.`;
      this.#leaveSeat();
    }
  }

  #updateSeat() {
    const mine = this.#store.own;
    if (this.#store.mode !== 'live' || !this.#store.connected || mine.length === 0) {
      this.#leaveSeat();
    } else if (this.seat === null || !mine.includes(this.seat)) {
      this.#enterSeat(mine[0]);
    }
  }

  #enterSeat(seat: string) {
    this.#unplugged = false;
    this.#reverse = this.#gearOf(seat) || this.gamepads.gateHeld;
    this.keyboard.release();
    this.#sender.seat = seat;
    window.crgame?.world?.follow?.(seat, true);
    // A focused button would keep its focus ring, and widgets might take the keys.
    if (document.activeElement instanceof HTMLElement) {
      document.activeElement.blur();
    }
  }

  #leaveSeat() {
    if (this.seat !== null) {
      if (this.#store.holds(this.seat)) {
        this.#connection.send({ type: 'input', seat: this.seat, away: true });
      }
      this.#sender.seat = null;
      this.keyboard.release();
    }
  }

  /** Return the gear of a vehicle, which a new driver keeps. */
  #gearOf(seat: string) {
    const row = this.#store.vehicleIndex(seat) * VEHICLE_WIDTH;
    return (this.#store.latest?.vehicles[row + VEHICLE.reverse] ?? NaN) > 0.5;
  }

  #focusChanged(reason: string | null) {
    if (reason !== null) {
      this.keyboard.release();
    }
    this.#sender?.update();
  }

  #moved(really: boolean) {
    if (really) {
      this.#unplugged = false;
    }
    this.#sender?.update();
  }

  #setReverse(reverse: boolean) {
    // A lever moved while the page has no focus counts; buttons pressed in calibration do not.
    if (this.seat !== null && this.focus.reason !== 'dialog' && reverse !== this.#reverse) {
      this.#reverse = reverse;
      this.#moved(true);
    }
  }

  #unplug() {
    this.#unplugged = this.seat !== null && !this.keyboard.anyHeld;
    this.#sender.update();
  }

  #subject() {
    const id = this.seat ?? window.crgame?.world?.followed ?? null;
    return {
      id, driven: this.seat !== null, away: this.away, lost: this.#lost, reverse: this.#reverse,
      driver: this.#driverOf(id),
    };
  }

  #driverOf(id: string | null) {
    const { seats, scene, me, connected, mode } = this.#store;
    const { active } = this.gamepads;
    if (this.seat !== null) {
      return active && !this.keyboard.anyHeld ? shortName(active.id) : 'Keyboard';
    }
    if (id === null) {
      return '';
    }
    if (mode === 'replay' && seats[id]?.source === 'cockpit') {
      const name = seats[id].holder_name;
      return name ? `Driven by ${name} in a cockpit` : 'Driven in a cockpit';
    }
    return connected && seats[id]
      ? describeSeat(seats[id], this.#store.vehicle(id)?.role, scene?.planners?.[id], me.id) : '';
  }
}

/** Put the instruments, the seats and the input devices into the page. */
export function createDriving(root: HTMLElement, store: Store, connection: Connection): Driving {
  const driving = new Driving(root, store, connection);
  new Seats(part(root, 'panel-drive'), store, connection, driving);
  return driving;
}
