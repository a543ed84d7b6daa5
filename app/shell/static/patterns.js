/* Patterns over the colours of cells, which tell them apart without colour. */
const SIZE = 10; // of a tile (px)
/** What is drawn in a tile, by the names of `app.render.patterns`; it goes on in the next one. */
const LINES = {
  rising: "M-2 2 2-2M0 10 10 0M8 12 12 8",
  falling: "M-2 8 2 12M0 0 10 10M8-2 12 2",
  crossed: "M0 0 10 10M10 0 0 10",
  squares: "M0 5H10M5 0V10",
  level: "M0 5H10",
  upright: "M5 0V10",
  dashes: "M1 3H5M6 8H10",
  zigzag: "M0 7 2.5 3 5 7 7.5 3 10 7",
  waves: "M0 5Q2.5 0 5 5T10 5",
  dots: "M5 4.2A.8.8 0 1 1 4.99 4.2",
  rings: "M5 2.5A2.5 2.5 0 1 1 4.99 2.5",
};
const most = matchMedia("(prefers-contrast: more)");

/** Whether patterns are shown: where they are switched on, or the system asks for contrast. */
export const patterned = (look) => Boolean(look?.patterned) || most.matches;

/** A tile of a pattern, dark on light colours and light on dark ones, for so many pixels a CSS pixel. */
export function tile(name, color, ratio) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = Math.round(SIZE * ratio);
  const context = canvas.getContext("2d"), [red, green, blue] = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
  context.scale(canvas.width / SIZE, canvas.height / SIZE);
  context.strokeStyle = 0.299 * red + 0.587 * green + 0.114 * blue > 110 ? "#000000a0" : "#ffffffc0";
  context.lineWidth = 1.3;
  context.stroke(new Path2D(LINES[name]));
  return canvas;
}
