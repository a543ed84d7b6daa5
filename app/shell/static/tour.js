/* The guided tour: six steps, each of which does on the page what the paper says, and a card of words. */
import { TURN } from "./frame.js";
import { unrolled } from "./unroll.js";
import { wrap } from "./map_pane.js";

const STORY = "pick_pour_place", LOG = "log_two_robots";
const TURNED = TURN / 6; // by how much the object turns
const PAPER = 23; // the paper's average time (ms) of hill climbing
const still = matchMedia("(prefers-reduced-motion: reduce)");

class Left extends Error {}

/** What a step does: words, and an action that is given the tour and may be left at any time. */
const STEPS = [
  {
    title: "The object unrolls into its map",
    words: "Around its axis z a bottle looks the same from every side, so a point of its surface is a height h and an angle θ from the polar axis a, with the radius r(h): it unrolls into a map (equations 1 and 2, figures 2 and 3).",
    async run(tour) {
      await tour.story();
      await tour.animate(1200, () => unrolled(tour.sheet, tour.pane, 0));
      await tour.animate(3200, (share) => unrolled(tour.sheet, tour.pane, share));
      tour.say("Now the map: h upwards, θ across.");
    },
  },
  {
    title: "Every cell is tried",
    words: "Algorithm 1 takes the centre of every cell back to the object, places the hand there, and asks whether the arm reaches it without touching anything.",
    async run(tour) {
      await tour.story();
      const { reason, feasible, heights, angles } = tour.pane.cells, size = heights * angles;
      await tour.animate(4000, (share) => {
        const visited = Math.round(share * size);
        tour.pane.visited = visited;
        tour.pane.redraw();
        const held = reason.subarray(0, visited).reduce((sum, value) => sum + (value === feasible), 0);
        tour.say(`${visited} of ${size} cells visited, ${held} feasible`);
      });
    },
  },
  {
    title: "A turn only shifts the map",
    words: "Turning the object by δ about its own axis shifts its map by δ, and changes nothing else (equations 3 to 5).",
    async run(tour) {
      await tour.story();
      tour.act("compare");
      await tour.animate(2500, (share) => tour.pane.turn(share * TURNED));
      const look = await tour.until(({ compared, delta, busy }) => compared && !busy && Math.abs(wrap(delta - tour.pane.delta)) < 1e-6);
      const [differing, cells] = look.compared;
      tour.say(`Counted against a map computed from scratch: ${differing} of ${cells} cells differ`);
    },
  },
  {
    title: "One grasp for all tasks",
    words: "The maps of pick, pour and place slide over each other, each by its own δ, until one grasp serves them all (Algorithm 2).",
    async run(tour) {
      await tour.story();
      tour.act("plan");
      await tour.until(({ plan, busy }) => plan.kind === "sequential" && !busy);
      tour.send({ do: "slid", share: 0 });
      await tour.until(({ plan }) => plan.slide === 0);
      await tour.animate(3500, (share) => {
        tour.send({ do: "slid", share });
        tour.say(tour.together());
      });
      await tour.until(({ plan }) => plan.slide === 1);
      tour.say(tour.together());
    },
  },
  {
    title: "Hands move apart",
    words: "Two hands leave prints on the map of a log, and hill climbing moves them until their prints share no cell (Algorithm 3).",
    async run(tour) {
      await tour.scene(LOG, "log");
      tour.act("climb");
      const { plan } = await tour.until((look) => look.plan.positions && !look.busy);
      tour.act("replay");
      await tour.until((look) => look.plan.playing === "climb");
      await tour.until((look) => look.plan.playing === "", () => tour.say(tour.together()));
      const time = (1000 * plan.seconds).toFixed(plan.seconds < 0.01 ? 1 : 0);
      tour.say(`${tour.together()}, after ${plan.positions} positions: ${time} ms here, checks of the whole robots included; ${PAPER} ms on average in the paper`);
    },
  },
  {
    title: "The plan plays",
    words: "The arm moves along a planned motion, from pick over pour to place, with the one grasp of Algorithm 2.",
    async run(tour) {
      await tour.story();
      tour.act("plan");
      await tour.until(({ plan, busy }) => plan.kind === "sequential" && !busy);
      tour.act("motion");
      tour.say("Planning the motion …");
      const { plan } = await tour.until((look) => look.plan.duration && !look.busy);
      tour.act("play");
      await tour.until((look) => look.plan.playing === "arms");
      await tour.until((look) => look.plan.playing === "", (look) => tour.say(`${look.plan.position.toFixed(1)} of ${plan.duration.toFixed(1)} s`));
      tour.say("Ctrl+Z leads back to what was there before.");
    },
  },
];

export class Tour {
  /**
   * @param {(id: string) => HTMLElement} element
   * @param {import("./map_pane.js").MapPane} pane the main map
   * @param {{send: (command: object) => void, begun: () => void}} on send goes to the server
   */
  constructor(element, pane, on) {
    Object.assign(this, { element, pane, on, send: on.send });
    this.card = element("tour");
    this.sheet = element("unroll");
    this.run = 0; // its number: what waits in an earlier one is left
    this.look = this.asked = null;
    this.watching = new Set();
    element("begin").addEventListener("click", () => this.show(0));
    element("back").addEventListener("click", () => this.show(this.step - 1));
    element("next").addEventListener("click", () => this.show(this.step + 1));
    element("skip").addEventListener("click", () => this.end());
    this.card.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.end();
      if (["Escape", "Enter", " "].includes(event.key)) event.stopPropagation(); // they mean nothing to the view
    });
  }

  /** Take what the server says of the page. */
  seen(look) {
    if (this.asked !== null && look.tour > this.asked) this.show(0); // from the palette
    this.asked = look.tour;
    this.look = look;
    for (const check of [...this.watching]) check();
  }

  async show(step) {
    if (step >= STEPS.length) {
      this.end();
      return;
    }
    this.leave();
    this.on.begun();
    this.step = Math.max(0, step);
    const run = this.run, { title, words, run: act } = STEPS[this.step];
    this.card.hidden = false;
    this.card.dataset.done = "false";
    this.element("tour-title").textContent = `${this.step + 1} of ${STEPS.length} · ${title}`;
    this.element("tour-words").textContent = words;
    this.say("");
    this.element("back").disabled = this.step === 0;
    this.element("next").textContent = this.step + 1 === STEPS.length ? "Finish" : "Next";
    this.element("next").focus();
    try {
      await act(this);
      if (run === this.run) this.card.dataset.done = "true";
    } catch (error) {
      if (!(error instanceof Left)) throw error;
    } finally {
      if (run === this.run) this.cover(false);
    }
  }

  /** Leave the step that is shown, and take back what only it needs. */
  leave() {
    this.run++;
    for (const check of [...this.watching]) check();
    this.cover(false);
    if (this.look?.compared || this.look?.compares) this.act("alone");
  }

  end() {
    this.leave();
    this.card.hidden = true;
    this.pane.canvas.focus({ preventScroll: true });
  }

  cover(shown) {
    this.sheet.hidden = !shown;
    if (!shown) this.pane.visited = null;
    this.pane.redraw();
  }

  say(text) {
    this.element("tour-said").textContent = text;
  }

  together() {
    return this.element("together").textContent;
  }

  act(name) {
    this.send({ do: "act", name });
  }

  /** Show the first scene without a plan, the object as it stands there. */
  story() {
    return this.scene(STORY, "story");
  }

  async scene(name, act) {
    const there = (look) => look.scene === name && !look.plan.kind && !look.busy && this.pane.hasMap;
    if (!this.look || !there(this.look) || this.look.delta) this.act(act);
    await this.until((look) => there(look) && !look.delta);
  }

  /** Wait until what the page shows is right; called with every look until then. */
  until(right, meanwhile = () => {}) {
    const run = this.run;
    return new Promise((resolve, reject) => {
      const check = () => {
        if (run !== this.run) reject(new Left());
        else if (!this.look || !right(this.look)) {
          if (this.look) meanwhile(this.look);
          return;
        } else resolve(this.look);
        this.watching.delete(check);
      };
      this.watching.add(check);
      check();
    });
  }

  /** Draw from share 0 to 1 over a time (ms); at once where the system asks for less motion. */
  animate(time, draw) {
    const run = this.run, begun = performance.now();
    return new Promise((resolve, reject) => {
      const frame = (now) => {
        if (run !== this.run) {
          reject(new Left());
          return;
        }
        const share = still.matches ? 1 : Math.min(1, Math.max(0, (now - begun) / time));
        draw(share);
        if (share < 1) requestAnimationFrame(frame);
        else resolve();
      };
      requestAnimationFrame(frame);
    });
  }
}
