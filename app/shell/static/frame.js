/* Where on the canvas a point of the map is: u is the share of the turn from θ = -180°, v that of the height. */
const NARROWEST = 1 / 40;

export const TURN = 2 * Math.PI;
export const mod = (a, n) => ((a % n) + n) % n;
export const degrees = (angle) => (angle * 360) / TURN;

/** A turn δ (rad) of the object as it is written everywhere: `turn_text` in `symgrasp.object.manifold`. */
export function turnText(delta) {
  const text = `${degrees(delta).toFixed(2)}°`;
  return text === "-0.00°" ? "0.00°" : text;
}

export class Frame {
  constructor() {
    this.lying = false; // heights along the x axis
    this.reset();
  }

  reset() {
    this.span = 1; // share of the map that is seen, in both directions
    this.u0 = this.v0 = 0; // its lowest θ and h
  }

  /** Put the map into a rectangle (CSS pixels). */
  place(x, y, width, height, lying) {
    Object.assign(this, { x, y, width, height, lying });
  }

  toScreen(u, v) {
    const a = (u - this.u0) / this.span, b = (v - this.v0) / this.span;
    const [right, up] = this.lying ? [b, a] : [a, b];
    return [this.x + right * this.width, this.y + this.height - up * this.height];
  }

  toMap(x, y) {
    const right = (x - this.x) / this.width, up = (this.y + this.height - y) / this.height;
    const [a, b] = this.lying ? [up, right] : [right, up];
    return [this.u0 + a * this.span, this.v0 + b * this.span];
  }

  contains(x, y) {
    return x >= this.x && x < this.x + this.width && y > this.y && y <= this.y + this.height;
  }

  /** Zoom by a factor about a point of the canvas, which keeps its place. */
  zoom(factor, x, y) {
    const [u, v] = this.toMap(x, y);
    const span = Math.min(1, Math.max(NARROWEST, this.span / factor));
    this.u0 = u - ((u - this.u0) * span) / this.span;
    this.v0 = v - ((v - this.v0) * span) / this.span;
    this.span = span;
    this.pan(0, 0);
  }

  /** Move what is seen by shares of the map. */
  pan(du, dv) {
    const most = 1 - this.span;
    this.u0 = Math.min(most, Math.max(0, this.u0 + du));
    this.v0 = Math.min(most, Math.max(0, this.v0 + dv));
  }
}
