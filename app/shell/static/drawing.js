/* How the map is drawn: cells, axes, marks, and the object's profile beside it, sharp at every size. */
import { TURN, mod } from "./frame.js";
import { patterned, tile } from "./patterns.js";

const FONT = "11px system-ui, sans-serif";
const ROOM = { left: 46, bottom: 38, top: 10, right: 12, profile: 64 };
const STRIP = { ...ROOM, bottom: 17, top: 7 }; // of several maps below each other
const RING = 6; // radius (px) of a mark
const LOW = 240; // height (px) below which a map that lies has all of it, without the profile
const NAMED = 64; // height (px) from which on an upward axis has its name
const GREY = [236, 238, 241], UNVISITED = "#f7f8fa";

/** A canvas with one pixel a cell, lowest θ left and highest h on top. */
export function texture({ heights, angles }, index, colors, alpha = 255) {
  const rgb = colors.map((color) => [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16)));
  const picture = new OffscreenCanvas(angles, heights);
  const context = picture.getContext("2d");
  const pixels = context.createImageData(angles, heights);
  for (let row = 0; row < heights; row++) {
    for (let column = 0; column < angles; column++) {
      const value = index[(heights - 1 - row) * angles + column];
      pixels.data.set([...rgb[value], alpha < 255 && !value ? 0 : alpha], 4 * (row * angles + column));
    }
  }
  context.putImageData(pixels, 0, 0);
  return picture;
}

/** Move a canvas to whole pixels of the screen: between them it would be blurred. */
function snap(canvas, ratio) {
  const box = canvas.getBoundingClientRect(), at = canvas.snapped ?? [0, 0];
  const by = [box.left, box.top].map((edge, k) => Math.round((edge - at[k]) * ratio) / ratio - (edge - at[k]));
  if (by.some((value, k) => Math.abs(value - at[k]) > 1e-3)) {
    canvas.snapped = by;
    canvas.style.margin = `${by[1]}px 0 0 ${by[0]}px`;
  }
}

/** Fit the canvas to its room, and the map into it: a long object lies along the longer side. */
export function layout(pane) {
  const { canvas, frame, cells } = pane;
  const ratio = devicePixelRatio, width = canvas.clientWidth, height = canvas.clientHeight;
  snap(canvas, ratio);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const around = cells ? TURN * Math.max(...cells.profile.map(([, r]) => r)) : 1;
  const lying = Boolean(cells) && pane.lies && cells.high - cells.low > around === width > height && width !== height && cells.high - cells.low > 1.25 * around;
  pane.alone = lying && (pane.strip || height < LOW);
  const { left, bottom, top, right } = pane.strip ? STRIP : ROOM, profile = pane.alone ? 0 : ROOM.profile;
  frame.place(left, top + (lying ? profile : 0), Math.max(20, width - left - right - (lying ? 0 : profile)),
    Math.max(20, height - top - bottom - (lying ? profile : 0)), lying);
}

/** The colours that have a pattern, each with its cells as a picture. */
export function masks(cells) {
  return (cells.patterns ?? []).flatMap((name, k) => {
    const drawn = cells.parts ?? cells;
    if (!name || !drawn.index.includes(k)) return [];
    return [{ name, color: cells.colors[k], cells: texture(drawn, drawn.index.map((value) => Number(value === k)), ["#000000", "#000000"], 254) }];
  });
}

export function draw(pane) {
  const { canvas, frame, cells, look, style } = pane;
  const context = canvas.getContext("2d"), ratio = devicePixelRatio;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  if (!cells || !look) return;
  const { x, y, width, height } = frame;
  context.save();
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
  context.imageSmoothingEnabled = false;
  context.globalAlpha = look.stale ? 0.3 : 1;
  if (look.stale) {
    context.globalAlpha = 1;
    context.fillStyle = `rgb(${GREY})`;
    context.fillRect(x, y, width, height);
    context.globalAlpha = 0.3;
  }
  const begin = mod((cells.start - pane.delta + Math.PI) / TURN, 1);
  drawCells(context, pane, pane.picture, begin);
  if (patterned(look)) drawPatterns(context, pane, begin);
  context.globalAlpha = 1;
  if (pane.visited !== null) {
    const left = cells.index.map((_, k) => Number(k >= pane.visited));
    drawCells(context, pane, texture(cells, left, [UNVISITED, UNVISITED], 254), begin);
  }
  if (pane.prints) drawCells(context, pane, pane.shade, 0);
  if (pane.hovered) outline(context, pane, pane.hovered);
  drawMarks(context, pane);
  context.restore();
  context.strokeStyle = style.line;
  context.lineWidth = 1;
  context.strokeRect(x - 0.5, y - 0.5, width + 1, height + 1);
  axes(context, pane);
  if (!pane.alone) profile(context, pane);
}

/** Draw a picture of all cells that begins at a share of the turn, and goes on from its other end. */
function drawCells(context, { frame }, picture, begin) {
  const ratio = devicePixelRatio, whole = (value) => Math.round(value * ratio) / ratio;
  for (const from of [begin - 1, begin]) {
    const [x0, y0] = frame.toScreen(from, 0).map(whole), [x1, y1] = frame.toScreen(from + 1, 1).map(whole);
    context.save();
    if (frame.lying) {
      context.transform(0, y1 - y0, x1 - x0, 0, x0, y0); // θ upwards, h to the right
      context.transform(1, 0, 0, -1, 0, 1);
    } else {
      context.transform(x1 - x0, 0, 0, y0 - y1, x0, y1);
    }
    context.drawImage(picture, 0, 0, 1, 1);
    context.restore();
  }
}

/** Fill the cells of every colour with its pattern, which moves with the map. */
function drawPatterns(context, pane, begin) {
  const { canvas, frame } = pane, ratio = devicePixelRatio;
  const sheet = new OffscreenCanvas(canvas.width, canvas.height), on = sheet.getContext("2d");
  const [x, y] = frame.toScreen(begin, 0);
  on.setTransform(ratio, 0, 0, ratio, 0, 0);
  on.imageSmoothingEnabled = false;
  for (const { name, color, cells } of pane.masks) {
    on.globalCompositeOperation = "source-over";
    on.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    drawCells(on, pane, cells, begin);
    on.globalCompositeOperation = "source-in";
    const fill = on.createPattern(tile(name, color, ratio), "repeat");
    fill.setTransform(new DOMMatrix().translate(x, y).scale(1 / ratio));
    on.fillStyle = fill;
    on.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    context.drawImage(sheet, 0, 0, canvas.clientWidth, canvas.clientHeight);
  }
}

function outline(context, pane, cell) {
  const { frame, cells, style } = pane, { low, high, heights, angles } = cells;
  const [theta, h] = pane.middle(cell);
  const u = (theta + Math.PI) / TURN, v = (h - low) / (high - low);
  for (const turn of [-1, 0, 1]) {
    const [x0, y0] = frame.toScreen(u + turn - 0.5 / angles, v - 0.5 / heights);
    const [x1, y1] = frame.toScreen(u + turn + 0.5 / angles, v + 0.5 / heights);
    for (const [color, wide] of [[style.halo, 4], [style.ink, 1.5]]) {
      context.strokeStyle = color;
      context.lineWidth = wide;
      context.strokeRect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
    }
  }
}

function drawMarks(context, { frame, cells, style, look }) {
  context.font = FONT;
  const marks = look.marks.map(([h, theta, label]) => {
    const [x, y] = frame.toScreen((theta + Math.PI) / TURN, (h - cells.low) / (cells.high - cells.low));
    return { x, y, label, wide: label ? context.measureText(label).width : 0 };
  });
  for (const { x, y } of marks) {
    for (const [color, wide] of [[style.halo, 5.5], [style.mark, 2.5]]) {
      context.strokeStyle = color;
      context.lineWidth = wide;
      context.beginPath();
      context.arc(x, y, RING, 0, TURN);
      context.stroke();
    }
  }
  context.textAlign = "left";
  context.textBaseline = "middle";
  placeLabels(marks, frame).forEach(({ x, y }, k) => {
    const { label, wide } = marks[k];
    if (!label) return;
    context.fillStyle = style.back;
    context.globalAlpha = 0.85;
    context.fillRect(x - 3, y - 8, wide + 6, 16);
    context.globalAlpha = 1;
    context.fillStyle = style.ink;
    context.fillText(label, x, y);
  });
}

/** Return where the labels of marks are written: beside them, or above or below that, and over no other label or
 * mark as long as there is room.
 * @param {{x: number, y: number, wide: number}[]} marks in pixels, with the width of the label, 0 for none
 * @param {{x: number, y: number, width: number, height: number}} room that the labels stay in
 */
export function placeLabels(marks, room) {
  const taken = marks.map(({ x, y }) => [x - RING - 2, y - RING - 2, x + RING + 2, y + RING + 2]);
  const box = ({ x, y }, wide) => [x - 3, y - 8, x + wide + 3, y + 8];
  const meets = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
  return marks.map(({ x, y, wide }, own) => {
    if (!wide) return { x, y };
    const right = { x: x + 11, y }, left = { x: x - 11 - wide, y };
    const sides = right.x + wide + 3 <= room.x + room.width ? [right, left] : [left, right];
    const places = [...sides];
    for (let off = 2; off < room.height; off += 2) {
      for (const up of [-off, off]) places.push(...sides.map((side) => ({ x: side.x, y: y + up })));
    }
    const inside = places.filter((place) => {
      const [low, top, high, bottom] = box(place, wide);
      return low >= room.x && high <= room.x + room.width && top >= room.y && bottom <= room.y + room.height;
    });
    const free = inside.find((place) => !taken.some((other, k) => k !== own && meets(box(place, wide), other)));
    const chosen = free ?? sides[0];
    taken.push(box(chosen, wide));
    return chosen;
  });
}

// -- axes -----------------------------------------------------------------------------------------

function axes(context, { frame, cells, style, strip }) {
  const { x, y, width, height, lying, span, u0, v0 } = frame;
  const low = 100 * cells.low, high = 100 * cells.high;
  const across = lying
    ? { from: low + v0 * (high - low), to: low + (v0 + span) * (high - low), name: "h (cm)" }
    : { from: 360 * u0 - 180, to: 360 * (u0 + span) - 180, name: "θ (°)", angle: true };
  const upwards = lying
    ? { from: 360 * u0 - 180, to: 360 * (u0 + span) - 180, name: "θ (°)", angle: true }
    : { from: low + v0 * (high - low), to: low + (v0 + span) * (high - low), name: "h (cm)" };
  context.font = FONT;
  context.fillStyle = style.ink;
  context.textAlign = "center";
  context.textBaseline = "top";
  for (const tick of ticks(across, width / 48)) {
    context.fillText(label(tick), x + ((tick - across.from) / (across.to - across.from)) * width, y + height + 4);
  }
  if (!strip) context.fillText(across.name, x + width / 2, y + height + 20);
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const tick of ticks(upwards, height / 28)) {
    context.fillText(label(tick), x - 5, y + height - ((tick - upwards.from) / (upwards.to - upwards.from)) * height);
  }
  context.save();
  context.translate(9, y + height / 2);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  if (height >= NAMED) context.fillText(upwards.name, 0, 0);
  context.restore();
}

const label = (value) => String(Number(value.toPrecision(6)) + 0).replace("-", "−");

/** Round values from one end of an axis to the other, so many at most. */
function ticks({ from, to, angle }, most) {
  const room = (to - from) / Math.max(3, most);
  const decade = 10 ** Math.floor(Math.log10(room));
  const steps = angle && room > 1 ? [5, 10, 15, 30, 45, 60, 90, 180] : [1, 2, 5, 10].map((k) => k * decade);
  const step = steps.find((value) => value >= room * (1 - 1e-9)) ?? steps.at(-1);
  const values = [];
  for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * step; k++) values.push(k * step);
  return values;
}

/**
 * Draw the half section of the object along its heights, beside the map or above one that lies, and bars where hands
 * can hold it.
 */
function profile(context, { frame, cells, look, style }) {
  const { x, y, width, lying } = frame, { low, high, profile: points } = cells;
  const most = Math.max(...points.map(([, r]) => r)), bars = 8 * look.holds.length, room = ROOM.profile - 16 - bars;
  const at = (h, r) => {
    const [across, up] = frame.toScreen(frame.u0, (h - low) / (high - low));
    return lying ? [across, y - 8 - (r / most) * room] : [x + width + 10 + (r / most) * room, up];
  };
  context.save();
  context.beginPath();
  if (lying) context.rect(x, 0, width, y);
  else context.rect(x + width + 2, y - 1, ROOM.profile + ROOM.right, frame.height + 2);
  context.clip();
  context.beginPath();
  context.moveTo(...at(points[0][0], 0));
  for (const [h, r] of points) context.lineTo(...at(h, r));
  context.lineTo(...at(points.at(-1)[0], 0));
  context.closePath();
  context.fillStyle = style.body;
  context.fill();
  context.strokeStyle = style.ink;
  context.lineWidth = 1.2;
  context.stroke();
  look.holds.forEach(([color, spans], k) => {
    for (const [from, to] of spans) {
      const beyond = most * (1 + (8 * (k + 1)) / room);
      const [x0, y0] = at(from, beyond), [x1, y1] = at(to, beyond);
      context.lineWidth = 6;
      context.strokeStyle = style.line;
      line(context, x0, y0, x1, y1);
      context.lineWidth = 4.5;
      context.strokeStyle = color;
      line(context, x0, y0, x1, y1);
    }
  });
  context.restore();
}

function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}
