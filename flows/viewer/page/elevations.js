// Both sides of each street as one walks along them: facades side by side, at scale.

import { evidenceColour, evidenceLegend } from "./columns.js";
import { blockPage, element, facadeAddress, picture } from "./elements.js";

const SCALES = [4, 8, 16]; // pixels of a metre
const BAR_PX = 6;

// Facades of a street on its left and on its right, from left to right as one faces them.
function sides(block, { name, id, line }) {
  const [[x0, y0], [x1, y1]] = [line[0], line.at(-1)];
  const [east, north] = [x1 - x0, y1 - y0];
  const fronts = block.facades.filter(({ street, role }) => role === "street" && (street === name || street === id)).map((facade) => {
    const [x, y] = [0, 1].map((axis) => (facade.line[0][axis] + facade.line[1][axis]) / 2);
    return { facade, along: (x - x0) * east + (y - y0) * north, left: east * (y - y0) - north * (x - x0) > 0 };
  });
  const sorted = fronts.sort((a, b) => a.along - b.along);
  return [sorted.filter(({ left }) => left), sorted.filter(({ left }) => !left).reverse()].map((side) => side.map(({ facade }) => facade));
}

export function elevationsPage(block, scale = SCALES[1]) {
  const front = (facade) => {
    const [width, height] = [facade.width_m, facade.height_m].map((metres) => Math.max(1, Math.round(scale * metres)));
    return element("a", { href: facadeAddress(facade.id), title: `${facade.id}: ${facade.evidence || facade.status}` },
      element("img", { src: picture(facade.id, "texture", block.snapshot, 2 * height), alt: `Facade ${facade.id}`, loading: "lazy", width, height }),
      element("svg", { width, height: BAR_PX, "aria-hidden": "true" }, element("rect", { width, height: BAR_PX, fill: evidenceColour(facade) })));
  };
  const strips = block.streets.flatMap((street) => sides(block, street).map((facades, side) => [street.name, ["left", "right"][side], facades]))
    .filter(([, , facades]) => facades.length);
  return [
    element("h2", {}, "Elevations"),
    element("div", { class: "controls" }, element("label", { for: "scale" }, "Scale"),
      element("select", { id: "scale", onchange: (event) => (location.hash = blockPage(`elevations/${event.target.value}`)) },
        ...SCALES.map((one) => element("option", { value: one, selected: one === scale }, `${one} pixels a metre`))), evidenceLegend()),
    ...strips.flatMap(([name, side, facades]) => [
      element("h3", {}, `${name}, ${side} side`),
      element("div", { class: "elevation", tabindex: 0, role: "region", "aria-label": `${name}, ${side} side` }, ...facades.map(front)),
    ]),
    strips.length ? null : element("p", {}, "No facade of this block is at a street."),
  ];
}
