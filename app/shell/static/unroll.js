/* The surface of the object on its way from the object to its map, as in figures 2 and 3 of the paper. */
import { TURN } from "./frame.js";

const FONT = "italic 15px system-ui, serif";

/** Draw it on a canvas over that of the map: share 0 is the object, 1 the map where it lies. */
export function unrolled(sheet, pane, share) {
  const ratio = devicePixelRatio, wide = pane.canvas.clientWidth, tall = pane.canvas.clientHeight;
  sheet.hidden = false;
  if (sheet.width !== Math.round(wide * ratio)) sheet.width = Math.round(wide * ratio);
  if (sheet.height !== Math.round(tall * ratio)) sheet.height = Math.round(tall * ratio);
  const context = sheet.getContext("2d"), { frame, cells, style } = pane;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = style.back;
  context.fillRect(0, 0, wide, tall);
  const { heights, angles, low, high, start, index, colors } = cells;
  const bend = 1 - share, middle = frame.x + frame.width / 2, scale = frame.height / (high - low);
  const flat = frame.width / TURN; // radius (px) whose circle is as long as the map is wide
  const radius = (h) => bend * scale * profileRadius(cells.profile, h) + share * flat;
  // A bent sheet: a part of a circle, which is whole at first and a line in the end.
  const across = (h, theta) => middle + (bend > 1e-3 ? (radius(h) / bend) * Math.sin(theta * bend) : radius(h) * theta);
  const up = (h) => frame.y + frame.height - (h - low) * scale;
  const columns = [...Array(angles).keys()].map((column) => start + ((column + 0.5) * TURN) / angles);
  const order = [...columns.keys()].sort((a, b) => Math.cos(bend * columns[a]) - Math.cos(bend * columns[b]));
  const tilt = bend * 0.16; // of the circles: seen a little from above
  const lift = (h, theta) => tilt * (bend > 1e-3 ? (radius(h) / bend) * (1 - Math.cos(theta * bend)) : 0);
  for (const column of order) {
    const theta = columns[column], half = TURN / angles / 2;
    for (let row = 0; row < heights; row++) {
      const h0 = low + (row * (high - low)) / heights, h1 = low + ((row + 1) * (high - low)) / heights;
      context.beginPath();
      for (const [h, angle] of [[h0, theta - half], [h0, theta + half], [h1, theta + half], [h1, theta - half]]) {
        context.lineTo(across(h, angle), up(h) - lift(h, angle));
      }
      context.closePath();
      context.fillStyle = context.strokeStyle = colors[index[row * angles + column]];
      context.fill();
      context.stroke(); // no seams between cells
    }
  }
  letters(context, { style, frame, low, high, middle, bend, across, up, lift });
}

function profileRadius(points, h) {
  for (let k = 1; k < points.length; k++) {
    const [h0, r0] = points[k - 1], [h1, r1] = points[k];
    if (h <= h1) return h1 > h0 ? r0 + ((r1 - r0) * (h - h0)) / (h1 - h0) : r1;
  }
  return points.at(-1)[1];
}

/** The axis z, the polar axis a, and h, r and θ of a point. */
function letters(context, { style, frame, low, high, middle, bend, across, up, lift }) {
  const h = low + 0.3 * (high - low), theta = 0.9, point = [across(h, theta), up(h) - lift(h, theta)];
  context.font = FONT;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.lineWidth = 1.5;
  context.strokeStyle = context.fillStyle = style.ink;
  context.globalAlpha = Math.min(1, 2 * bend); // the axes stay with the object
  const foot = up(low) - lift(low, Math.PI / 2);
  if (bend > 0.02) {
    arrow(context, [middle, foot], [middle, frame.y - 4], "z", [6, 6]);
    arrow(context, [middle, foot], [middle, foot + 34], "a", [8, 0]);
    const level = up(h) - lift(h, Math.PI / 2);
    line(context, [middle, level], point);
    name(context, "r", (middle + point[0]) / 2 - 3, (level + point[1]) / 2 - 11);
  }
  context.globalAlpha = 1;
  const left = frame.x - 16;
  arrow(context, [left, up(low)], [left, point[1]], "h", [-18, (up(low) - point[1]) / 2]);
  line(context, [left, point[1]], point);
  context.beginPath(); // θ, from θ = 0 to the point
  for (let k = 0; k <= 24; k++) context.lineTo(across(low, (theta * k) / 24), up(low) - lift(low, (theta * k) / 24) + 12);
  context.stroke();
  name(context, "θ", across(low, theta / 2) - 4, up(low) + 26);
  context.fillStyle = style.mark;
  context.beginPath();
  context.arc(...point, 5, 0, TURN);
  context.fill();
}

function line(context, from, to) {
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.stroke();
}

function arrow(context, from, to, text, [dx, dy]) {
  line(context, from, to);
  const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
  for (const side of [-0.45, 0.45]) {
    line(context, to, [to[0] - 9 * Math.cos(angle + side), to[1] - 9 * Math.sin(angle + side)]);
  }
  name(context, text, to[0] + dx, to[1] + dy);
}

function name(context, text, x, y) {
  context.lineWidth = 4;
  const ink = context.strokeStyle;
  context.strokeStyle = "#ffffffd0";
  context.strokeText(text, x, y);
  context.strokeStyle = ink;
  context.fillStyle = "#1d2733";
  context.fillText(text, x, y);
  context.lineWidth = 1.5;
}
