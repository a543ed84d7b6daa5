/* The page: makes the token that ties map and view together, and hands what one says to the other. */
import { Link } from "./link.js";
import { Layers } from "./layers.js";
import { MapPane } from "./map_pane.js";
import { Invitation } from "./invitation.js";
import { describe } from "./legend.js";
import { watchPlaces } from "./places.js";
import { Tour } from "./tour.js";
import { Visit } from "./visit.js";
import { narrow, split } from "./splitter.js";

const element = (id) => document.getElementById(id);
const view = element("view"), canvas = element("map");

const visit = new Visit();
const opened = location.search.slice(1);
view.src = `/?${opened ? `${opened}&` : ""}page=${visit.tokens}${narrow.matches ? "&stacked" : ""}`;
const stack = () => view.contentDocument?.documentElement.toggleAttribute("data-stacked", narrow.matches);
view.addEventListener("load", stack);
view.addEventListener("load", () => view.classList.add("loaded"));
narrow.addEventListener("change", stack);
// viser connects again only while its own document has the focus.
view.addEventListener("load", () => view.contentWindow.focus());

const HINT = "Point at a cell to read it, click to take it.";
const say = (text) => { element("readout").textContent = text || HINT; };
const pane = new MapPane(canvas, {
  send: (command) => link.send(command),
  say,
  speak: (text) => { element("spoken").textContent = text; },
  turned: (text) => { element("turn").textContent = text; },
});
/* What changes while a pointer is down, here or in the view, is one drag. */
let presses = 0;
function watchPresses(target) {
  target.addEventListener("pointerdown", () => link.send({ do: "press", number: ++presses }), true);
  for (const name of ["pointerup", "pointercancel"]) {
    target.addEventListener(name, () => link.send({ do: "release" }), true);
  }
}
watchPresses(window);
view.addEventListener("load", () => watchPresses(view.contentWindow));

const layers = new Layers(element, {
  send: (command) => link.send(command),
  say,
});
const tour = new Tour(element, pane, {
  send: (command) => link.send(command),
  begun: () => invitation.answer(),
});
const invitation = new Invitation(element, () => tour.show(0));
const arrived = [];
const link = new Link(`/map/${visit.token}`, {
  message: (head, data) => {
    visit.remember();
    arrived.push([head, data]);
    if (head.kind !== "look") return;
    for (const message of arrived.splice(0)) { // all of them are shown with the look
      if (message[0].layer === undefined) pane.apply(...message);
      if (message[0].layer !== undefined || message[0] === head) layers.take(...message);
    }
    if (element("nothing").hidden !== pane.hasMap) say("");
    element("nothing").hidden = pane.hasMap;
    document.documentElement.dataset.theme = head.dark ? "dark" : "light";
    pane.restyle();
    layers.restyle();
    describe(element, pane);
    tour.seen(head);
  },
  closed: () => {
    element("title").setAttribute("aria-busy", "true");
    view.contentWindow?.focus(); // what viser waits for, see above
  },
});
split(element("splitter"));
watchPlaces(view, (command) => link.send(command));

/* Keys that mean nothing here are the view's: its commands, and the palette of them. */
document.addEventListener("keydown", (event) => {
  if (event.defaultPrevented || ["Tab", "Shift", "Control", "Alt", "Meta"].includes(event.key)) return;
  const there = view.contentWindow;
  if (!there) return;
  if (event.ctrlKey || event.metaKey) {
    if (event.key !== "k" && event.key !== "z" && event.key !== "Z" && event.key !== "s") return;
    event.preventDefault();
    if (event.key === "k") there.focus();
  }
  const { key, code, ctrlKey, metaKey, shiftKey, altKey } = event;
  const same = { key, code, ctrlKey, metaKey, shiftKey, altKey, bubbles: true, cancelable: true };
  there.document.body.dispatchEvent(new there.KeyboardEvent("keydown", same));
});
