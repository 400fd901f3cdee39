// Pages of one block: what to look at, a facade's stages, its streets, how its run goes.

import { ask, blockPage, element, facadeAddress, legend, openBase, picture } from "./elements.js";
import { changeMap } from "./changes.js";
import { REMEDIES, STATUS, said } from "./columns.js";

// Facades that the list of those to look at shows.
const LISTED = 200;
// Stages that tell how a facade came about, in one row: what was there, what was found in it, what it became.
const STORY = ["source", "rectified", "parse", "layout", "texture"];

// A run that was killed leaves work that nobody does.
export const fate = (progress) => (progress.ended ? "the run has ended" : progress.under_way ? "the run is in progress" : "the run was interrupted; run the block again to resume");
const sentence = (words) => words[0].toUpperCase() + words.slice(1);

// What `quality` says is amiss, with the texture beside it; first what is most doubtful where most of it is seen, as in the report.
export function reviewPage(block, correct) {
  const ids = block.to_look_at;
  const facades = new Map(block.facades.map((facade) => [facade.id, facade]));
  return [
    element("h2", {}, `${ids.length} of ${block.facades.length} facades to look at`),
    ids.length ? element("p", {}, "Each has a flag other than an assumed height in the column quality. A click shows the reason and the remedy.")
      : element("p", {}, "No flags other than assumed heights. To look at or correct another facade, choose it on the ", element("a", { href: "#/map" }, "Map"), "."),
    element("div", { class: "stages" }, ...ids.slice(0, LISTED).map((id) => facades.get(id)).map((facade) =>
      element("figure", {},
        element("a", { href: facadeAddress(facade.id) },
          element("img", { src: picture(facade.id, "texture", block.snapshot), alt: `Texture of facade ${facade.id}`, loading: "lazy" })),
        element("figcaption", {}, element("a", { href: facadeAddress(facade.id) }, facade.id), `, ${facade.street}: ${facade.quality}; `,
          `${said(facade.floors)} floors, ${said(facade.levels)} by the map; ${Math.round(100 * (facade.occluded || 0))} % hidden`,
          facade.corrected ? "; corrected " : " ", correct(facade.id))))),
    ids.length > LISTED ? element("p", {}, `The first ${LISTED} are shown; quality in items.parquet has all.`) : null,
  ];
}

export async function facadePage(block, id, number, correct) {
  const index = block.facades.findIndex((facade) => facade.id === id);
  if (index < 0) return [element("p", { class: "failed" }, `There is no facade ${id} in this block.`)];
  const facade = block.facades[index];
  const details = await ask(`api/facade?id=${encodeURIComponent(id)}`);
  const go = (by) => (location.hash = facadeAddress(block.facades[(index + by + block.facades.length) % block.facades.length].id));
  const story = STORY.flatMap((name) => details.stages.find(({ stage }) => stage === name) || []);
  const others = details.stages.filter((one) => !story.includes(one));
  const shownColumns = block.columns.filter((column) => facade[column.name] !== undefined);
  return [
    element("h2", {}, `Facade ${id}`),
    element(
      "div", { class: "controls" },
      element("button", { type: "button", onclick: () => go(-1) }, "Previous facade"),
      element("button", { type: "button", onclick: () => go(1) }, "Next facade"),
      element("span", {}, `${index + 1} of ${block.facades.length}, ${facade.street}`),
      element("a", { href: `#/map/${number}/${encodeURIComponent(id)}` }, "On the map"),
      facade.status === "done" ? element("a", { href: `#/model/${number}/${encodeURIComponent(id)}` }, "In 3D") : null,
      correct(id),
    ),
    details.reason && facade.status === "failed" ? element("p", { class: "failed" }, `Failed: ${details.reason}`) : null,
    facade.status === "waiting" ? element("p", {}, "Not made yet.") : null,
    ...remedies(facade),
    element("div", { class: "stages story" }, ...story.map((one) => stageFigure(id, one, details.snapshot, one.stage))),
    story.some(({ stage }) => stage === "parse") ? legend(block.parse_colours) : null,
    facts(shownColumns.filter(({ common }) => common), facade),
    facade.changed === undefined ? null : changeMap(facade, details, block.changed_from),
    others.length ? element("details", {}, element("summary", {}, "All steps"), element("div", { class: "stages" }, ...others.map((one) => stageFigure(id, one, details.snapshot)))) : null,
    element("details", {}, element("summary", {}, "All properties"), valuesTable(shownColumns, facade)),
    Object.keys(details.seconds).length
      ? element("p", {}, "Seconds: ", Object.entries(details.seconds).map(([name, value]) => `${name} ${value.toFixed(2)}`).join(", "))
      : null,
  ];
}

function stageFigure(id, { stage, title }, snapshot, kind = null) {
  const address = picture(id, stage, snapshot);
  return element("figure", { class: kind },
    element("a", { href: address, target: "_blank" }, element("img", { src: address, alt: `${title} of facade ${id}`, loading: "lazy" })),
    element("figcaption", {}, title));
}

function facts(columns, facade) {
  return element("dl", { class: "facts" }, ...columns.map(({ name, label, unit, words }) =>
    element("div", {}, element("dt", {}, label), element("dd", {}, said(facade[name], unit, words)))));
}

function valuesTable(columns, facade) {
  return element("table", {},
    element("thead", {}, element("tr", {}, ...["Name", "Value", "Column", "Meaning"].map((text) => element("th", { scope: "col" }, text)))),
    element("tbody", {}, ...columns.map(({ name, label, meaning, unit, words }) =>
      element("tr", {}, ...[label, said(facade[name], unit, words), name, meaning].map((text) => element("td", {}, text))))));
}

// What is amiss with a facade, and what mends it.
function remedies(facade) {
  const flags = (facade.quality || "good").split(", ").filter((flag) => REMEDIES[flag]);
  return flags.length ? [element("ul", { class: "remedies" }, ...flags.map((flag) => element("li", {}, REMEDIES[flag](facade))))] : [];
}

// Parts of a street's page, whose slider is the third.
export function streetPage(block, progress, street, step, redraw, smallMap) {
  if (!block.viewpoints.length) return [element("h2", {}, "Streets"), element("p", {}, "This block has no viewpoints: no street sees a wall.")];
  const withViews = block.streets.map((_, i) => i).filter((i) => block.viewpoints.some((viewpoint) => viewpoint.street === i));
  if (!withViews.includes(street)) street = withViews[0];
  const own = block.viewpoints.map((_, i) => i).filter((i) => block.viewpoints[i].street === street);
  step = Math.max(0, Math.min(step, own.length - 1));
  const seen = new Set(own.slice(0, step + 1).flatMap((viewpoint) => block.seen[viewpoint]));
  const viewpoint = own[step];
  const done = progress && (progress.done_viewpoints || []).includes(viewpoint);
  const slider = element("input", {
    id: "step", type: "range", min: 0, max: own.length - 1, value: step,
    "aria-valuetext": `viewpoint ${step + 1} of ${own.length}`,
    oninput: (event) => history.replaceState(null, "", blockPage(`street/${street}/${event.target.value}`)) || redraw(),
  });
  const choose = element("select", { id: "street", onchange: (event) => (location.hash = blockPage(`street/${event.target.value}/0`)) },
    ...withViews.map((i) => element("option", { value: i, selected: i === street }, block.streets[i].name)));
  const shot = (kind, alt, title) => element("figure", { class: "panorama" },
    element("img", { src: picturesOf(kind, viewpoint, progress?.snapshot || block.snapshot), alt, id: kind }), element("figcaption", {}, title));
  return [
    element("h2", {}, `Street ${block.streets[street].name}`),
    element("div", { class: "controls" }, element("label", { for: "street" }, "Street"), choose,
      element("label", { for: "step" }, `Viewpoint ${step + 1} of ${own.length}`)),
    slider,
    element("div", { class: "split" },
      done
        ? element("div", {}, shot("panorama", `Panorama at viewpoint ${step + 1}`, "What the viewpoint sees, as far as it is finished"),
            shot("grown", `The street after viewpoint ${step + 1}`, "The street after this viewpoint: what no picture decides yet is pale, what is not the street's is grey"))
        : element("p", {}, "This viewpoint is not textured yet."),
      smallMap(block, { colour: (facade) => STATUS[facade.status], strong: (index) => seen.has(index), here: block.viewpoints[viewpoint].at,
        choose: (id) => (location.hash = facadeAddress(id)), label: `Map: the ${seen.size} facades that the street has seen so far stand out` })),
  ];
}

const picturesOf = (kind, viewpoint, snapshot) => `${openBase()}picture/${kind}?viewpoint=${viewpoint}&of=${snapshot}`;

export function runPage(block, progress) {
  const cell = (text, kind = "") => element("td", { class: kind }, String(text));
  const head = (...names) => element("thead", {}, element("tr", {}, ...names.map((text) => element("th", { scope: "col" }, text))));
  const units = (list) => list.length
    ? element("table", {}, head("Stage", "Unit", "Reason"), element("tbody", {}, ...list.map((unit) =>
        element("tr", {}, cell(unit.stage),
          unit.stage === "facades" ? element("td", {}, element("a", { href: facadeAddress(unit.unit) }, unit.unit)) : cell(unit.unit),
          cell(unit.reason)))))
    : element("p", {}, "Nothing.");
  return [
    element("h2", {}, sentence(fate(progress))),
    element("table", {}, head("Stage", "Progress", "Done", "Failed", "Stale", "Of"), element("tbody", {}, ...progress.stages.map((stage) =>
      element("tr", {}, cell(stage.name, "name"),
        element("td", {}, element("progress", { max: stage.total, value: stage.done + stage.failed, "aria-label": `${stage.name}: ${stage.done + stage.failed} of ${stage.total}` })),
        cell(stage.done, "number"), cell(stage.failed, "number"), cell(stage.stale, "number"), cell(stage.total, "number"))))),
    element("h3", {}, `Failed or refused: ${progress.failures.length}`),
    units(progress.failures),
    progress.stale.length ? element("h3", {}, `Out of date: ${progress.stale.length}`) : null,
    progress.stale.length ? units(progress.stale) : null,
    block.notes.length ? element("h3", {}, "Notes") : null,
    block.notes.length ? element("ul", {}, ...block.notes.map((note) => element("li", {}, note))) : null,
    element("p", {}, `Coordinates: ${block.crs}. Snapshot ${block.snapshot}.`),
  ];
}

// The blocks of a city: state, facades, why one failed; page: that a block opens with.
export function blocksPage(city, page) {
  const { blocks, notes, under_way: underWay } = city.said;
  const order = ["failed", "running", "stale", "waiting", "done"];
  const sorted = [...blocks].sort((a, b) => order.indexOf(a.state) - order.indexOf(b.state));
  return [
    element("h2", {}, `${blocks.length} blocks${underWay ? "; the run of the city is in progress" : ""}`),
    element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Blocks" }, element("table", { class: "block-list" },
      element("thead", {}, element("tr", {}, ...["Block", "State", "Facades", "Failed", "Place"].map((text) => element("th", { scope: "col" }, text)))),
      element("tbody", {}, ...sorted.map((block) => element("tr", {},
        element("td", {}, element("a", { href: `#/block/${block.number}/${page}` }, city.called(block.number)), block.title ? element("span", { class: "keys" }, ` ${block.name}`) : null),
        element("td", {}, block.reason ? `${block.state}: ${block.reason}` : block.state),
        element("td", { class: "number" }, String(block.facades)), element("td", { class: "number" }, String(block.failed)),
        element("td", {}, block.outline.length ? element("a", { href: `#/map/${block.number}`, "aria-label": `${city.called(block.number)} on the map` }, "On the map") : null)))))),
    notes.length ? element("h3", {}, "Notes") : null,
    notes.length ? element("ul", {}, ...notes.map((note) => element("li", {}, note))) : null,
  ];
}
