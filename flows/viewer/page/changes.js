// What changed of a facade between two captures: how much, when, where, and both pictures.

import { element, legend, picture, pictureBefore } from "./elements.js";

// From as it was to changed, and what one of both does not show; readable with any colour vision.
const ALIKE = "#d9dee2";
const STEPS = ["#f0d9a0", "#e8b04a", "#d8741f", "#a8330f"];
const HIDDEN = "#6b7680";
const percent = (share) => `${Math.round(100 * share)} %`;
const colour = (cell) => (cell === "-" ? HIDDEN : cell === "0" ? ALIKE : STEPS[Math.min(STEPS.length - 1, Math.floor((Number(cell) * STEPS.length) / 10))]);

export function changeMap(facade, details, from) {
  const { map, before } = details.change;
  const [rows, columns] = [map.length, map[0]?.length ?? 0];
  const said = facade.changed >= from ? "changed" : "unchanged";
  const svg = element("svg", { viewBox: `0 0 ${columns} ${rows}`, role: "img", "aria-label": `Where facade ${facade.id} changed: ${percent(facade.changed)} of what both captures show` },
    ...map.flatMap((line, y) => [...line].map((cell, x) => element("rect", { x, y, width: 1.02, height: 1.02, fill: colour(cell) }))));
  const now = details.stages.find(({ stage }) => stage === "hidden") || details.stages.find(({ stage }) => stage === "rectified");
  const shown = (src, alt, title) => element("figure", {}, element("img", { src, alt }), element("figcaption", {}, title));
  return element("section", { class: "changes", "aria-label": "What changed" },
    element("h3", {}, `Changed: ${percent(facade.changed)} of what both captures show, which counts as ${said}`),
    element("p", {}, `${facade.capture_date_before ?? "before"} to ${facade.capture_date ?? "now"}; both show ${percent(facade.compared)} of the facade. What stands in front in either is left out.`),
    rows
      ? element("div", { class: "stages" },
          before ? shown(pictureBefore(facade.id, details.snapshot), `Facade ${facade.id} before`, `${facade.capture_date_before ?? "Before"}, grey where it is hidden`) : null,
          now ? shown(picture(facade.id, now.stage, details.snapshot), `Facade ${facade.id} now`, facade.capture_date ?? "Now") : null,
          element("figure", {}, svg, element("figcaption", {}, "Where it changed")))
      : element("p", {}, "Where it changed was not kept yet: the next run does."),
    rows ? legend([[ALIKE, "as it was"], [STEPS[0], "changed a little"], [STEPS[3], "changed throughout"], [HIDDEN, "not shown by both"]]) : null);
}
