/* The token of this page, and that of the page that it continues: itself before it was loaded again. */
const KEY = "symgrasp-page";

export class Visit {
  constructor() {
    this.token = btoa(String.fromCharCode(...crypto.getRandomValues(new Uint8Array(24))))
      .replaceAll("+", "-").replaceAll("/", "_");
    this.tokens = [this.token, ...this.before()].join(".");
    this.remembered = false;
  }

  /** Return the token of the page that this tab showed before at the same address, if there is one. */
  before() {
    const [navigation] = performance.getEntriesByType("navigation");
    if (location.search && navigation?.type === "navigate") return []; // a link was opened, perhaps again
    try {
      const { token, address } = JSON.parse(sessionStorage.getItem(KEY));
      return typeof token === "string" && address === location.href ? [token] : [];
    } catch { // nothing is there, or the browser keeps nothing
      return [];
    }
  }

  /** Let this page be continued, once it has a session: till then that is the page before it. */
  remember() {
    if (this.remembered) return;
    this.remembered = true;
    try {
      sessionStorage.setItem(KEY, JSON.stringify({ token: this.token, address: location.href }));
    } catch { // the browser keeps nothing
    }
  }
}
