/* The invitation to the tour: stands above the map until it was answered in this browser, which remembers it. */
const KEY = "symgrasp.tour";

export class Invitation {
  /** @param {(id: string) => HTMLElement} element @param {() => void} accepted begins the tour */
  constructor(element, accepted) {
    this.box = element("invitation");
    element("accept").addEventListener("click", accepted);
    element("decline").addEventListener("click", () => {
      this.answer();
      element("map").focus({ preventScroll: true });
    });
    try {
      this.box.hidden = localStorage.getItem(KEY) !== null;
    } catch { // a browser that keeps nothing would be asked at every visit
    }
  }

  /** The tour was begun, from wherever, or is not wanted. */
  answer() {
    this.box.hidden = true;
    try { localStorage.setItem(KEY, "offered"); } catch { /* as above */ }
  }
}
