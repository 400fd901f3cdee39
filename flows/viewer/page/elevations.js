// Both sides of each street as one walks along them: facades side by side, at scale.

import { evidenceColour, evidenceLegend, STATUS } from "./columns.js";
import { blockPage, element, facadeAddress, picture } from "./elements.js";
import { placeAt } from "./geometry.js";

const SCALES = [4, 8, 16]; // pixels of a metre
const BAR_PX = 6;

// Facades of a street on its left and on its right, from left to right as one faces them.
export function sides(block, { id, line }) {
  const fronts = block.facades.filter((facade) => facade.role === "street" && facade.street_id === id);
  const sorted = fronts.map((facade) => ({ facade, ...placeAt(line, facade.line) })).sort((a, b) => a.along - b.along || a.beyond - b.beyond);
  return [sorted.filter(({ left }) => left), sorted.filter(({ left }) => !left).reverse()].map((side) => side.map(({ facade }) => facade));
}

export function elevationsPage(block, scale = SCALES[1]) {
  const front = (facade) => {
    const [width, height] = [facade.width_m, facade.height_m].map((metres) => Math.max(1, Math.round(scale * metres)));
    return element("a", { href: facadeAddress(facade.id), title: `${facade.id}: ${facade.evidence || facade.status}` },
      facade.status === "done" || facade.status === "stale"
        ? element("img", { src: picture(facade.id, "texture", block.snapshot, 2 * height), alt: `Facade ${facade.id}`, loading: "lazy", width, height })
        : element("svg", { class: "not-made", width, height, role: "img", "aria-label": `Facade ${facade.id}: ${facade.status}` }, element("rect", { width, height, fill: STATUS[facade.status] })),
      element("svg", { width, height: BAR_PX, "aria-hidden": "true" }, element("rect", { width, height: BAR_PX, fill: evidenceColour(facade) })));
  };
  const strips = block.streets.flatMap((street) => sides(block, street).map((facades, side) => [street.name.trim() || street.id, ["left", "right"][side], facades]))
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
