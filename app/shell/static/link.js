/* The websocket of the map: opened again whenever it closes. */
const FIRST_PAUSE = 200, LONGEST_PAUSE = 3000, INTERVAL = 25;
/** Commands of which only the newest counts, sent at most every INTERVAL ms. */
const VALUES = {
  turn: () => "turn", hover: () => "hover", leave: () => "hover",
  slid: () => "slid", slide: ({ step }) => `slide ${step}`, move: ({ step, hand }) => `move ${step} ${hand}`,
};

export class Link {
  /**
   * @param {string} path of the websocket
   * @param {{message: (head: object, data: DataView) => void, closed: () => void}} on
   */
  constructor(path, on) {
    this.address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`;
    this.on = on;
    this.pause = FIRST_PAUSE;
    this.waiting = new Map();
    this.open();
  }

  open() {
    this.socket = new WebSocket(this.address);
    this.socket.binaryType = "arraybuffer";
    this.socket.addEventListener("message", ({ data }) => {
      this.pause = FIRST_PAUSE;
      const length = new DataView(data).getUint32(0, true);
      const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
      this.on.message(head, data.slice(4 + length));
    });
    this.socket.addEventListener("close", () => {
      this.on.closed();
      setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(2 * this.pause, LONGEST_PAUSE);
    });
  }

  send(command) {
    const value = VALUES[command.do]?.(command);
    if (!value) {
      this.flush(); // what came before it goes before it
      this.post(command);
      return;
    }
    this.waiting.delete(value);
    this.waiting.set(value, command);
    this.timer ??= setTimeout(() => this.flush(), INTERVAL);
  }

  flush() {
    clearTimeout(this.timer);
    this.timer = undefined;
    for (const command of this.waiting.values()) this.post(command);
    this.waiting.clear();
  }

  post(command) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(command));
  }
}
