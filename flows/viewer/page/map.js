// The map of a block, or of what lies around a place; y runs down on the page.

import { element, facadeAddress } from "./elements.js";

// `strong` may say which facades are drawn in full; `here` is a place to mark, `heading` whither somebody looked there, degrees;
// `within` are corners [low, high] of the part that is shown; `called` may give facades a sign; `choose` is told which was chosen.
export function map(block, { colour, strong = () => true, here = null, heading = null, within = null, called = () => null, choose = null, label }) {
  const [low, high] = within || [[0, 0], block.size];
  const height = block.size[1];
  const size = [high[0] - low[0], high[1] - low[1]];
  const free = 0.04 * Math.max(...size, 20);
  const thick = Math.max(...size, 20) / 130;
  const flip = ([x, y]) => [x, height - y];
  const shown = ([[x1, y1], [x2, y2]]) => !within || (Math.max(x1, x2) > low[0] - free && Math.min(x1, x2) < high[0] + free && Math.max(y1, y2) > low[1] - free && Math.min(y1, y2) < high[1] + free);
  const svg = element("svg", {
    viewBox: `${low[0] - free} ${height - high[1] - free} ${size[0] + 2 * free} ${size[1] + 2 * free}`,
    role: "img",
    "aria-label": label,
  });
  for (const street of block.streets) {
    const points = street.line.map((point) => flip(point).join(" ")).join("L");
    svg.append(element("path", { class: "street", d: `M${points}`, "stroke-width": thick * 0.9 }, element("title", {}, street.name)));
  }
  const signs = [];
  block.facades.forEach((facade, number) => {
    if (!shown(facade.line)) return;
    const [[x1, y1], [x2, y2]] = facade.line.map(flip);
    svg.append(
      element(
        "line",
        {
          class: "facade", "data-facade": facade.id, x1, y1, x2, y2, stroke: colour(facade), "stroke-width": thick,
          opacity: strong(number) ? 1 : 0.25, onclick: () => (choose ? choose(facade.id) : (location.hash = facadeAddress(facade.id))),
        },
        element("title", {}, `${facade.id}: ${facade.street}, ${facade.status}`),
      ),
    );
    const sign = called(facade);
    if (!sign) return;
    const [x, y] = [(x1 + x2) / 2, (y1 + y2) / 2];
    signs.push(element("circle", { class: "sign", cx: x, cy: y, r: thick * 2.6 }), element("text", { x, y: y + thick * 1.3, "font-size": thick * 3.8, "text-anchor": "middle" }, sign));
  });
  svg.append(...signs);
  if (here) {
    const [cx, cy] = flip(here);
    if (heading !== null) {
      const [east, north] = [Math.sin((heading * Math.PI) / 180), Math.cos((heading * Math.PI) / 180)];
      svg.append(element("line", { class: "looks", x1: cx, y1: cy, x2: cx + 9 * thick * east, y2: cy - 9 * thick * north, "stroke-width": thick * 0.5 }));
    }
    svg.append(element("circle", { class: "here", cx, cy, r: thick * 1.1, "stroke-width": thick * 0.3 }));
  }
  return element("div", { class: "map" }, svg);
}
