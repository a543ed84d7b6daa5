/* The stack of maps below the main one: of tasks, of hands, of rolls. Each is the same element as the main map. */
import { TURN, mod, turnText } from "./frame.js";
import { MapPane } from "./map_pane.js";

const COLUMNS = 1440; // four a degree, as many as the angles that a drag stops at
const SHARED = ["#eceef1", "#5fbf77"], WORDS = ["excluded by some task", "serves all of them"];

export class Layers {
  /** @param {(id: string) => HTMLElement} element @param {{send: (command: object) => void, say: (text: string) => void}} on */
  constructor(element, on) {
    this.section = element("layers");
    this.list = element("stack");
    this.together = element("together");
    this.planned = element("planned");
    this.on = on;
    this.rows = [];
    this.common = new Map(); // group → the map of what its layers share
    this.planned.addEventListener("click", () => on.send({ do: "planned" }));
  }

  /** Keep a message about one of the maps, or show what the look of all says. */
  take(head, data) {
    if (head.kind === "look") this.show(head);
    else this.row(head.layer).pane.apply(head, data);
  }

  show(look) {
    const layers = look.layers;
    for (const { box } of this.rows.splice(layers.length)) box.remove();
    this.looks = layers;
    this.showing = true; // counted once all of them are there
    layers.forEach((layer, k) => {
      const { pane, name, box, swatch } = this.row(k);
      name.textContent = layer.title;
      swatch.hidden = !layer.color;
      swatch.style.background = layer.color ?? "";
      box.classList.toggle("shown", layer.shown);
      box.classList.toggle("high", layer.kind === "hand");
      pane.lies = layer.kind === "hand";
      pane.canvas.classList.toggle("slides", layer.kind !== "hand");
      pane.apply({ ...layer, kind: "look", title: layer.title, dark: look.dark, patterned: look.patterned, legend: [] });
      pane.restyle();
    });
    this.section.hidden = !layers.length;
    this.apart = look.apart ?? "";
    this.planned.hidden = !look.moved;
    this.showing = false;
    this.count();
  }

  /** The row of a layer by its index, made where there is none yet. */
  row(k) {
    for (let i = this.rows.length; i <= k; i++) this.rows.push(this.made(i));
    return this.rows[k];
  }

  made(k) {
    const [box, head, swatch, name, turn, canvas] = ["figure", "figcaption", "i", "b", "output", "canvas"].map((tag) => document.createElement(tag));
    canvas.tabIndex = 0;
    canvas.dataset.testid = "layer";
    canvas.setAttribute("role", "img");
    head.append(swatch, name, turn);
    box.append(head, canvas);
    this.list.append(box);
    const pane = new MapPane(canvas, {
      send: (command) => this.sent(k, command),
      say: this.on.say,
      speak: () => {},
      turned: () => {
        const { planned, kind } = this.looks?.[k] ?? {};
        const by = planned == null ? "" : ` (plan: ${turnText(planned)})`;
        turn.textContent = kind === "task" || kind === "roll" ? `turned by ${turnText(pane.delta)}${by}` : "";
        this.count();
      },
      move: (hand, row, column) => this.on.send({ do: "move", step: this.looks[k].step, hand, row, column }),
    });
    pane.strip = true;
    return { box, name, turn, swatch, pane };
  }

  /** Send what was done to a layer as what it means there. */
  sent(k, command) {
    const { kind, step } = this.looks[k];
    if (command.do === "turn") this.on.send(kind === "task" ? { do: "slide", step, delta: command.delta } : command);
    else if (command.do !== "pick") return; // pointing previews grasps of the main map alone
    else if (kind === "roll") this.on.send({ ...command, roll: k });
    else this.on.send({ do: "show", step });
  }

  /** Count the cells that all layers with one grasp share, and draw them below the last of these layers. */
  count() {
    if (this.showing) return;
    const of = new Map();
    (this.looks ?? []).forEach((look, k) => {
      if (look.kind !== "task" || !this.rows[k]?.pane.cells) return;
      of.set(look.group, [...(of.get(look.group) ?? []), k]);
    });
    const texts = [];
    for (const [group, members] of of) {
      if (members.length < 2) continue;
      const shared = this.shared(members);
      const cells = Math.round((shared.reduce((sum, value) => sum + value, 0) * this.rows[members[0]].pane.cells.angles) / COLUMNS);
      texts.push(`all ${members.length} over each other: ${cells} common ${cells === 1 ? "cell" : "cells"}`);
      this.overlay(group, members, shared);
    }
    for (const [group, { box }] of this.common) {
      if ((of.get(group)?.length ?? 0) > 1) continue;
      box.remove();
      this.common.delete(group);
    }
    this.together.textContent = [...texts, this.apart].filter(Boolean).join(" · ");
  }

  /** Where one roll at least is feasible in all layers, each shifted by its own angle: (heights · COLUMNS). */
  shared(members) {
    const { heights } = this.rows[members[0]].pane.cells;
    const shared = new Uint8Array(heights * COLUMNS).fill(this.looks[members[0]].rolls);
    for (const k of members) {
      const { cells: { angles, start, rolls }, delta } = this.rows[k].pane;
      for (let column = 0; column < COLUMNS; column++) {
        const turn = mod(((column + 0.5) * TURN) / COLUMNS - Math.PI + delta - start, TURN);
        const at = Math.min(angles - 1, Math.floor((turn * angles) / TURN));
        for (let row = 0; row < heights; row++) shared[row * COLUMNS + column] &= rolls[row * angles + at];
      }
    }
    return shared.map((bits) => (bits ? 1 : 0));
  }

  overlay(group, members, shared) {
    let row = this.common.get(group);
    if (!row) {
      row = this.made(-1);
      row.pane.on.send = row.pane.on.turned = () => {};
      row.pane.fixed = true;
      row.pane.canvas.dataset.testid = "common";
      row.pane.canvas.classList.add("slides");
      row.swatch.hidden = true;
      row.name.textContent = "over each other";
      this.common.set(group, row);
    }
    this.rows[members.at(-1)].box.after(row.box);
    const { heights, low, high, profile } = this.rows[members[0]].pane.cells;
    const size = heights * COLUMNS, data = new Uint8Array(6 * size).fill(0xff, 0, 2 * size);
    data.set(shared, 2 * size);
    data.set(shared, 3 * size);
    row.pane.apply({
      kind: "cells", heights, angles: COLUMNS, low, high, profile, start: -Math.PI,
      colors: SHARED, reasons: WORDS, feasible: -1,
    }, data.buffer);
    const { marks } = this.looks[members[0]];
    row.pane.apply({ kind: "look", title: "over each other", delta: 0, marks, holds: [], legend: [] });
    row.pane.restyle();
  }

  restyle() {
    for (const { pane } of [...this.rows, ...this.common.values()]) pane.restyle();
  }
}
