/* The map: holds what the server says of it, and does what is done to it. */
import { Frame, TURN, degrees, mod, turnText } from "./frame.js";
import { draw, layout, masks, texture } from "./drawing.js";

const CLICK = 5; // how far (px) a pointer may move in a click
const STEP = Math.PI / 720; // that of the slider (rad)
const UNKNOWN = 0xffff;
export const wrap = (angle) => mod(angle + Math.PI, TURN) - Math.PI;

export class MapPane {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {{send: (command: object) => void, say: (text: string) => void, speak: (text: string) => void,
   *   turned: (text: string) => void, move?: (hand: number, row: number, column: number) => void}} on move is
   *   called where prints of hands are dragged
   */
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on;
    this.frame = new Frame();
    this.pointers = new Map();
    this.cells = this.prints = this.look = this.own = this.hovered = this.awaited = null;
    this.strip = false; // one of several below each other: axes without names
    this.lies = true; // a long object lies along the longer side
    this.fixed = false; // cannot be turned
    this.visited = null; // number of cells, row by row, that are shown; all of them if null
    new ResizeObserver(() => this.redraw()).observe(canvas);
    matchMedia("(resolution: 1dppx)").addEventListener("change", () => this.redraw());
    const listen = (name, act) => canvas.addEventListener(name, act.bind(this));
    listen("pointerdown", this.pressed);
    listen("pointermove", this.moved);
    listen("pointerup", this.released);
    listen("pointercancel", this.cancelled);
    listen("pointerleave", this.left);
    listen("keydown", this.key);
    listen("dblclick", this.reset);
    canvas.addEventListener("wheel", this.wheel.bind(this), { passive: false });
    this.restyle();
  }

  get hasMap() {
    return Boolean(this.cells);
  }

  /** The turn of the object (rad): the one that is being dragged, else the server's. */
  get delta() {
    return this.own ?? this.look?.delta ?? 0;
  }

  /** Take a message. */
  apply(head, data) {
    const size = head.heights * head.angles;
    if (head.kind === "cells") {
      this.cells = size ? {
        ...head,
        clearance: new Uint16Array(data, 0, size),
        index: new Uint8Array(data, 2 * size, size),
        reason: new Uint8Array(data, 3 * size, size),
        roll: new Uint8Array(data, 4 * size, size),
        rolls: new Uint8Array(data, 5 * size, size),
      } : null;
      if (head.parts) {
        const [heights, angles] = head.parts;
        this.cells.parts = { heights, angles, index: new Uint8Array(data, 6 * size, heights * angles) };
      }
      this.awaited = null;
      if (this.cells) {
        const drawn = this.cells.parts ?? this.cells;
        this.picture = texture(drawn, drawn.index, this.cells.colors);
        this.masks = masks(this.cells);
      }
    } else if (head.kind === "prints") {
      this.prints = size ? { ...head, index: new Uint8Array(data, 0, size) } : null;
      if (this.prints) this.shade = texture(head, this.prints.index, head.colors, 205);
    } else {
      this.look = head;
      this.settle();
      this.canvas.setAttribute("aria-label", `Unwrapped map: ${head.title}`);
      if (this.awaited && String(head.picked) === String(this.awaited)) {
        this.awaited = null;
        if (this.cells) this.on.speak(this.text(head.picked));
      }
    }
  }

  restyle() {
    const style = getComputedStyle(document.documentElement);
    this.style = Object.fromEntries(
      ["ink", "faint", "back", "line", "body", "mark", "halo", "focus"].map((name) => [name, style.getPropertyValue(`--${name}`)]),
    );
    this.redraw();
  }

  redraw() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      layout(this);
      draw(this);
    });
  }

  // -- cells ----------------------------------------------------------------------------------

  /** The cell [row, column] of the unshifted map at a point of the canvas; null beside the map. */
  cellAt(x, y) {
    if (!this.cells || !this.frame.contains(x, y)) return null;
    const { heights, angles, start } = this.cells;
    const [u, v] = this.frame.toMap(x, y);
    const turn = mod(u * TURN - Math.PI + this.delta - start, TURN);
    const row = Math.min(heights - 1, Math.max(0, Math.floor(v * heights)));
    return [row, Math.min(angles - 1, Math.floor((turn * angles) / TURN))];
  }

  /** θ (rad) in the frame of the turned object, and h (m), of the middle of a cell. */
  middle([row, column]) {
    const { heights, angles, start, low, high } = this.cells;
    return [wrap(start + ((column + 0.5) * TURN) / angles - this.delta), low + ((row + 0.5) * (high - low)) / heights];
  }

  text(cell) {
    const { angles, reason, reasons, clearance, roll, feasible } = this.cells;
    const at = cell[0] * angles + cell[1];
    const [theta, h] = this.middle(cell);
    const clear = clearance[at] === UNKNOWN ? "" : `, clearance ${(clearance[at] / 10).toFixed(1)} mm`;
    const held = reason[at] === feasible ? `, roll ${180 * roll[at]}°${clear}` : "";
    return `h ${(100 * h).toFixed(1)} cm · θ ${degrees(theta).toFixed(1)}° · ${reasons[reason[at]]}${held}`;
  }

  // -- pointers -------------------------------------------------------------------------------

  pressed(event) {
    if (event.button) return;
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    const inside = this.frame.contains(event.offsetX, event.offsetY);
    this.drag = this.pointers.size === 1 && inside && this.cells
      ? { id: event.pointerId, x: event.offsetX, y: event.offsetY, delta: this.delta, moves: false,
        hand: this.handAt(event.offsetX, event.offsetY) }
      : null;
  }

  moved(event) {
    const { offsetX: x, offsetY: y, pointerId: id } = event;
    const before = this.pointers.get(id);
    if (before && this.pointers.size === 2) {
      this.pinched(id, before, [x, y]);
      return;
    }
    if (before) this.pointers.set(id, [x, y]);
    if (this.drag?.id === id) this.dragged(x, y, before);
    else if (event.pointerType !== "touch") this.hover(this.cellAt(x, y));
  }

  dragged(x, y, before) {
    const drag = this.drag;
    drag.moves ||= Math.hypot(x - drag.x, y - drag.y) > CLICK;
    if (!drag.moves) return;
    this.hover(null);
    const [u1, v1] = this.frame.toMap(drag.x, drag.y), [u, v] = this.frame.toMap(x, y);
    if (drag.hand) {
      const { hand, row, column } = drag.hand;
      this.carry(hand, row + Math.round((v - v1) * this.prints.heights), column + Math.round((u - u1) * this.prints.angles));
      return;
    }
    if (this.prints && this.on.move || this.fixed) return;
    this.turn(drag.delta - (u - u1) * TURN);
    if (this.frame.span < 1) this.frame.pan(0, this.frame.toMap(...before)[1] - v);
  }

  /** The hand whose print is at a point of the canvas, with its cell in the frame of the turned object. */
  handAt(x, y) {
    if (!this.on.move || !this.prints) return null;
    const { heights, angles, index } = this.prints, [u, v] = this.frame.toMap(x, y);
    const row = Math.min(heights - 1, Math.floor(v * heights)), column = Math.min(angles - 1, Math.floor(u * angles));
    if (!index[row * angles + column]) return null;
    const cells = this.look.marks.map((mark) => this.cellOf(mark));
    const apart = ([i, j]) => Math.hypot(i - row, mod(j - column + angles / 2, angles) - angles / 2);
    const hand = cells.reduce((best, cell, k) => (apart(cell) < apart(cells[best]) ? k : best), 0);
    return { hand, row: cells[hand][0], column: cells[hand][1] };
  }

  /** The cell [row, column] of a grasp in the frame of the turned object. */
  cellOf([h, theta]) {
    const { heights, angles } = this.prints, { low, high } = this.cells;
    const row = Math.floor(((h - low) / (high - low)) * heights), turn = mod(theta + Math.PI, TURN);
    return [Math.min(heights - 1, Math.max(0, row)), Math.min(angles - 1, Math.floor((turn * angles) / TURN))];
  }

  /** Move a hand to a cell in the frame of the turned object. */
  carry(hand, row, column) {
    const { heights, angles } = this.prints;
    const cell = [hand, Math.min(heights - 1, Math.max(0, row)), mod(column, angles)];
    if (String(cell) === String(this.carried)) return;
    this.carried = cell;
    this.on.move(...cell);
  }

  pinched(id, before, now) {
    const [other] = [...this.pointers].filter(([key]) => key !== id).map(([, at]) => at);
    this.drag = null;
    const apart = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]);
    this.pointers.set(id, now);
    const between = (at) => [(at[0] + other[0]) / 2, (at[1] + other[1]) / 2];
    this.frame.zoom(apart(now) / Math.max(1, apart(before)), ...between(before));
    const [u0, v0] = this.frame.toMap(...between(before)), [u1, v1] = this.frame.toMap(...between(now));
    this.frame.pan(u0 - u1, v0 - v1); // what is between the fingers goes with them
    this.redraw();
  }

  released(event) {
    const drag = this.drag;
    this.pointers.delete(event.pointerId);
    if (drag?.id !== event.pointerId) return;
    this.drag = this.carried = null;
    if (!drag.moves) this.pick(this.cellAt(event.offsetX, event.offsetY));
    else {
      this.settle();
      setTimeout(() => this.settle(true), 1500);
    }
  }

  /** Take the server's turn again once it is that of the last drag, or anyway. */
  settle(anyway = false) {
    const answered = this.own !== null && Math.abs(wrap(this.look.delta - this.own)) < 1e-6;
    if (!this.drag && (anyway || answered)) this.own = null;
    this.on.turned(`turned by ${turnText(this.delta)}`);
    this.redraw();
  }

  cancelled(event) {
    this.pointers.delete(event.pointerId);
    this.drag = null;
  }

  left() {
    this.hover(null);
  }

  wheel(event) {
    event.preventDefault();
    this.frame.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), event.offsetX, event.offsetY);
    this.redraw();
  }

  reset() {
    this.frame.reset();
    this.redraw();
  }

  // -- deeds ----------------------------------------------------------------------------------

  hover(cell) {
    if (String(cell) === String(this.hovered)) return;
    this.hovered = cell;
    this.on.send(cell ? { do: "hover", row: cell[0], column: cell[1] } : { do: "leave" });
    this.on.say(cell ? this.text(cell) : "");
    this.redraw();
  }

  pick(cell) {
    if (!cell) return;
    this.on.send({ do: "pick", row: cell[0], column: cell[1] });
    this.on.say(this.text(cell));
  }

  /** Turn the object to an angle (rad), rounded as the slider does. */
  turn(delta) {
    const own = wrap(Math.round(delta / STEP) * STEP);
    if (own === this.own) return;
    this.own = own;
    this.on.send({ do: "turn", delta: own });
    this.on.turned(`turned by ${turnText(own)}`);
    this.redraw();
  }

  key(event) {
    if (!this.cells || event.ctrlKey || event.metaKey || event.altKey) return;
    const zoom = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
    const [right, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [0, 0];
    if (zoom) {
      const { x, y, width, height } = this.frame;
      this.frame.zoom(zoom, x + width / 2, y + height / 2);
    } else if (event.key === "0") {
      this.frame.reset();
    } else if (right || up) {
      const [around, along] = this.frame.lying ? [up, right] : [right, up];
      if (this.fixed) return;
      if (this.on.move && this.prints) this.stepHand(along, around);
      else if (event.shiftKey || this.strip) this.turn(this.delta - around * 4 * STEP);
      else this.step(along, around);
    } else {
      return;
    }
    event.preventDefault();
    this.redraw();
  }

  stepHand(along, around) {
    const { hand, marks } = this.look, [row, column] = this.cellOf(marks[hand]);
    this.carried = null;
    this.carry(hand, row + along, column + around);
  }

  step(along, around) {
    const { heights, angles } = this.cells;
    const [row, column] = this.awaited ?? this.look?.picked ?? [Math.floor(heights / 2), Math.floor(angles / 2)];
    const cell = [Math.min(heights - 1, Math.max(0, row + along)), mod(column + around, angles)];
    this.awaited = cell; // keys may be faster than answers
    this.pick(cell);
  }
}
