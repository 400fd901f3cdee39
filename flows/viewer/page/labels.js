// Names on a map: of streets along them, of blocks in their middle; none over another.

import { element } from "./elements.js";

const FONT_PX = 12;
const CHARACTER_PX = 6.6;
const MOST = 40;
// Bends of a street that a name along it does not follow.
const BEND_PX = 4;

// streets: [{name, points [[x, y]]}] as the map draws them; plane: what it shows.
export function streetLabels(streets, plane) {
  const box = plane.box();
  const { scale } = plane.place;
  const candidates = [];
  for (const { name, points: corners } of streets) {
    const points = straightened(corners, BEND_PX / scale);
    for (let i = 1; i < points.length; i++) {
      const piece = clip(points[i - 1], points[i], box);
      if (!piece) continue;
      const [[x1, y1], [x2, y2]] = piece;
      const length = scale * Math.hypot(x2 - x1, y2 - y1);
      if (length >= 0.75 * CHARACTER_PX * name.length) candidates.push({ name, length, at: [(x1 + x2) / 2, (y1 + y2) / 2], angle: upright((Math.atan2(y2 - y1, x2 - x1) * 180) / Math.PI) });
    }
  }
  candidates.sort((a, b) => b.length - a.length);
  const placed = [];
  for (const one of candidates) {
    const radius = (CHARACTER_PX * one.name.length) / 2;
    const clear = placed.every((other) => {
      const away = scale * Math.hypot(one.at[0] - other.at[0], one.at[1] - other.at[1]);
      return away > (one.name === other.name ? 320 : 0.7 * (radius + other.radius));
    });
    if (clear && placed.length < MOST) placed.push({ ...one, radius });
  }
  return placed.map(({ name, at: [x, y], angle }) =>
    element("text", { class: "street-name", "font-size": FONT_PX / scale, "stroke-width": 3 / scale, "text-anchor": "middle", transform: `translate(${x} ${y}) rotate(${angle.toFixed(1)})`, dy: (0.35 * FONT_PX) / scale }, name));
}

// blocks: [{box, name}] as the map draws them.
export function blockLabels(blocks, plane) {
  const [x0, y0, x1, y1] = plane.box();
  const { scale } = plane.place;
  return blocks.flatMap(({ box, name }) => {
    const [x, y] = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
    const most = Math.floor((scale * (box[2] - box[0])) / CHARACTER_PX);
    if (most < 6 || x < x0 || x > x1 || y < y0 || y > y1) return [];
    const text = name.length > most ? `${name.slice(0, most - 1)}\u2026` : name;
    return [element("text", { class: "block-name", x, y, "font-size": FONT_PX / scale, "stroke-width": 3 / scale, "text-anchor": "middle" }, text)];
  });
}

// A line without the corners that are within some distance of it.
function straightened(points, within) {
  const [[x1, y1], [x2, y2]] = [points[0], points.at(-1)];
  const length = Math.hypot(x2 - x1, y2 - y1) || 1;
  let [worst, most] = [0, within];
  points.forEach(([x, y], i) => {
    const away = Math.abs((x2 - x1) * (y - y1) - (y2 - y1) * (x - x1)) / length;
    if (away > most) [worst, most] = [i, away];
  });
  return worst ? [...straightened(points.slice(0, worst + 1), within).slice(0, -1), ...straightened(points.slice(worst), within)] : [points[0], points.at(-1)];
}

// Text that is read from the left, or from below.
const upright = (angle) => (angle > 90 ? angle - 180 : angle <= -90 ? angle + 180 : angle);

// The part of a line within a box; null without one.
function clip([ax, ay], [bx, by], [x0, y0, x1, y1]) {
  let [from, to] = [0, 1];
  for (const [start, by_, low, high] of [[ax, bx - ax, x0, x1], [ay, by - ay, y0, y1]]) {
    if (Math.abs(by_) < 1e-9) {
      if (start < low || start > high) return null;
      continue;
    }
    const [near, far] = [(low - start) / by_, (high - start) / by_].sort((p, q) => p - q);
    [from, to] = [Math.max(from, near), Math.min(to, far)];
  }
  return from < to ? [[ax + from * (bx - ax), ay + from * (by - ay)], [ax + to * (bx - ax), ay + to * (by - ay)]] : null;
}
