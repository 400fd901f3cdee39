// The page with the blocks in 3D.

import { evidenceLegend } from "./columns.js";
import { ask, blockBase, element } from "./elements.js";
import { distance } from "./geometry.js";
import { View } from "./model.js";

// How far from a facade's foot line a place on its wall may be, metres; balconies project.
const REACH_M = 2;
// Blocks that are asked for a street where a walk may begin.
const TRIED = 5;
// How far in front of a facade one stands, metres.
const MIN_AWAY_M = 6;
const MAX_AWAY_M = 15;

// Put the page into `fill`; facade: [block, id] of the one to stand before, or null; open: called with (block, facade id) of what
// was clicked.
export async function modelPage(city, near, facade, fill, open) {
  const start = facade ? await standBefore(city, ...facade) : await findStart(city, near);
  const canvas = element("canvas", { id: "model", tabindex: 0, role: "img", "aria-label": "The textured blocks in 3D; keys are told below" });
  const note = element("p", { class: "note", role: "status" });
  const figures = element("p", { class: "figures" });
  let view = null;
  const act = (change) => () => { change(); view.dirty = true; canvas.focus(); };
  const bird = element("button", { type: "button", id: "bird", onclick: act(() => view.fly()) }, "Bird's view / street");
  const held = (key, text, label) => element("button", { type: "button", "data-key": key, "aria-label": label }, text);
  const key = element("div", { hidden: true });
  const shade = element("button", { type: "button", id: "shade", "aria-pressed": "false", onclick: act(() => {
    key.hidden = !key.hidden;
    shade.setAttribute("aria-pressed", String(!key.hidden));
    view.tiles.shade(!key.hidden);
  }) }, "Evidence");
  const full = element("button", { type: "button", onclick: () => { canvas.parentElement.requestFullscreen?.(); canvas.focus(); } }, "Full screen");
  fill(
    element("div", { class: "model" }, canvas, note, figures,
      element("div", { class: "pad" }, held("KeyW", "\u25b2", "Walk ahead"), held("KeyA", "\u25c0", "Walk to the left"),
        held("KeyS", "\u25bc", "Walk back"), held("KeyD", "\u25b6", "Walk to the right"))),
    element("div", { class: "controls" }, bird, shade, full, key,
      element("span", {}, "W A S D or arrows walk, Shift faster, Q E or drag look, wheel nearer, B bird's view and back; a click, or Enter in the middle, opens a facade")),
  );
  key.append(evidenceLegend());
  let said = "";
  view = new View(canvas, city, start, {
    told: (text, numbers) => {
      if (!said && note.textContent !== text) note.textContent = text;
      if (figures.textContent !== numbers) figures.textContent = numbers;
    },
    found: async (number, at) => {
      const id = facadeAt(await city.load(number), at);
      if (id) open(number, id);
      else {
        said = note.textContent = "That is no facade: a roof, a back wall without one, or the ground.";
        setTimeout(() => { said = ""; }, 3000);
      }
    },
  });
  canvas.view = view; // for tests and for who looks for a fault
  canvas.focus({ preventScroll: true });
  return view;
}

// A place from which a facade is seen whole, and the direction to it.
async function standBefore(city, number, id) {
  const block = await city.load(number);
  const facade = block.facades.find((one) => one.id === id);
  if (!facade) throw new Error(`There is no facade ${id} in ${city.called(number)}.`);
  const [{ anchor }, first, last] = [await ask("api/start", blockBase(number, city.single)), facade.line[0], facade.line.at(-1)];
  const away = Math.min(MAX_AWAY_M, Math.max(MIN_AWAY_M, distance(first, [last, last]), facade.height_m || 0));
  const faces = (facade.azimuth_deg * Math.PI) / 180;
  const [east, north] = [0, 1].map((axis) => block.origin[axis] + (first[axis] + last[axis]) / 2 + away * [Math.sin(faces), Math.cos(faces)][axis]);
  return { anchor: [east, north, anchor[2]], heading: (facade.azimuth_deg + 180) % 360 };
}

// The facade whose wall is nearest to a place in world metres; null where none is near.
function facadeAt(block, [east, north]) {
  const place = [east - block.origin[0], north - block.origin[1]];
  const [nearest] = block.facades.map(({ id, line }) => ({ id, away: distance(place, line) })).sort((a, b) => a.away - b.away);
  return nearest?.away < REACH_M ? nearest.id : null;
}

// Where a walk begins: on a street of the block that is nearest to what the map shows; else a place to fly over.
async function findStart(city, near) {
  const published = city.blocks.filter((block) => block.published && (block.outline.length || city.single));
  if (!published.length) throw new Error("Nothing is published yet: the model appears when the first block is finished.");
  const middle = ({ outline }) => [0, 1].map((axis) => outline.reduce((sum, point) => sum + point[axis], 0) / Math.max(1, outline.length));
  const far = (block) => { const [x, y] = middle(block); return Math.hypot(x - near[0], y - near[1]); };
  const [first, ...others] = [...published].sort((a, b) => far(a) - far(b));
  let [failure, flight] = [null, null];
  for (const { number } of [first, ...others].slice(0, TRIED)) {
    try {
      const start = await ask("api/start", blockBase(number, city.single));
      if (start.heading !== null) return start;
      flight ??= start;
    } catch (error) {
      failure = error;
    }
  }
  if (flight) return flight;
  throw failure;
}
