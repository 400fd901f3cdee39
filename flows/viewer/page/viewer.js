// The run's page. Addresses: #/map, #/review, #/facade/ID, #/street/NUMBER/STEP, #/model, #/run; for who corrects #/edit/ID and #/photos/NAME.

import { ask, element, facadeAddress, legend, picture, said } from "./elements.js";
import { changeMap } from "./changes.js";
import { map } from "./map.js";

const main = document.getElementById("main");
const state = document.getElementById("state");
let block = null; // what /api/block said last
let progress = null; // what /api/progress said last
let colouredBy = "status";
let changedOnly = false; // whether the map shows those alone that changed between two captures
let shown = ""; // the address that is drawn
let correcting = null; // for who may correct
let timer = 0;

// A run that was killed leaves work that nobody does.
const fate = (said) => said.ended ? "the run has ended" : said.under_way ? "the run is going on" : "the run was cut off; run the block again to go on";
const sentence = (words) => words[0].toUpperCase() + words.slice(1);

const LOOK_AGAIN_MS = 2000;
// Facades that the list of those to look at shows.
const LISTED = 200;
// From low to high, readable with any colour vision.
const SCALE = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#d8c31a"];
const GROUPS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#5b3a8c", "#a03030"];
const STATUS = { done: "#1c7a43", failed: "#b3261e", waiting: "#8b949c" };
const UNKNOWN = "#b9bfc4";

const fill = (...parts) => main.replaceChildren(...parts.filter((part) => part !== null));

// How a column colours facades: {of(facade) -> colour, legend: [[colour, text]]}.
function colouring(name) {
  const values = block.facades.map((facade) => facade[name]).filter((value) => value !== undefined);
  if (name === "status") {
    return { of: (facade) => STATUS[facade.status] || UNKNOWN, legend: Object.entries(STATUS).map(([text, colour]) => [colour, text]) };
  }
  if (values.length && values.every((value) => typeof value === "number")) {
    const low = Math.min(...values);
    const high = Math.max(...values);
    const unit = block.columns.find((column) => column.name === name)?.unit || "";
    const step = (value) => SCALE[high > low ? Math.min(SCALE.length - 1, Math.floor(((value - low) / (high - low)) * SCALE.length)) : 0];
    const steps = high > low ? SCALE : SCALE.slice(0, 1);
    const from = (i) => low + ((high - low) * i) / steps.length;
    return {
      of: (facade) => (facade[name] === undefined ? UNKNOWN : step(facade[name])),
      legend: [...steps.map((colour, i) => [colour, `from ${said(from(i), unit)}`]), [UNKNOWN, "unknown"]],
    };
  }
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) || 0) + 1);
  const common = [...counts.entries()].sort((a, b) => b[1] - a[1]).slice(0, GROUPS.length).map(([value]) => value);
  return {
    of: (facade) => (common.includes(facade[name]) ? GROUPS[common.indexOf(facade[name])] : UNKNOWN),
    legend: [...common.map((value, i) => [GROUPS[i], String(value)]), [UNKNOWN, "other or unknown"]],
  };
}

function drawMap() {
  const chosen = element(
    "select",
    { id: "coloured-by", onchange: (event) => { colouredBy = event.target.value; draw(true); } },
    ...["status", "street", ...block.columns.map((column) => column.name).filter((name) => !["status", "street"].includes(name))].map((name) =>
      element("option", { value: name, selected: name === colouredBy }, name),
    ),
  );
  const compared = block.facades.some((facade) => facade.changed !== undefined);
  const changed = (facade) => facade.changed >= block.changed_from;
  const only = element("input", { id: "changed-only", type: "checkbox", checked: changedOnly, onchange: (event) => {
    changedOnly = event.target.checked;
    colouredBy = changedOnly ? "changed" : colouredBy;
    draw(true).then(() => document.getElementById("changed-only")?.focus());
  } });
  const strong = (number) => !(compared && changedOnly) || changed(block.facades[number]);
  const scheme = colouring(colouredBy);
  const filter = element("input", { id: "filter", type: "search", placeholder: "id, street or status", oninput: () => list() });
  const rows = element("tbody");
  const count = element("span", { role: "status" });
  const list = () => {
    const wanted = filter.value.trim().toLowerCase();
    const found = block.facades.filter((f, number) => strong(number) && (!wanted || `${f.id} ${f.street} ${f.status} ${f.building}`.toLowerCase().includes(wanted)));
    if (compared && changedOnly) found.sort((a, b) => b.changed - a.changed);
    rows.replaceChildren(
      ...found.slice(0, 500).map((facade) =>
        element(
          "tr", {},
          element("td", {}, element("a", { href: facadeAddress(facade.id) }, facade.id)),
          element("td", {}, facade.street),
          element("td", { class: typeof facade[colouredBy] === "number" ? "number" : "" }, said(facade[colouredBy])),
        ),
      ),
    );
    count.textContent = `${found.length} of ${block.facades.length} facades${found.length > 500 ? ", the first 500 shown" : ""}`;
  };
  list();
  fill(
    element("h2", {}, "Map"),
    element("div", { class: "controls" }, element("label", { for: "coloured-by" }, "Colour by"), chosen, element("label", { for: "filter" }, "Find"), filter,
      compared ? element("span", {}, only, element("label", { for: "changed-only" }, " changed between two captures")) : null, count),
    element(
      "div", { class: "split" },
      element("div", {}, map(block, { colour: scheme.of, strong, label: `Map of ${block.facades.length} facades coloured by ${colouredBy}; the table lists them` }), legend(scheme.legend)),
      element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Facades" },
        element("table", {}, element("thead", {}, element("tr", {}, ...["Facade", "Street", colouredBy].map((text) => element("th", { scope: "col" }, text)))), rows)),
    ),
  );
}

const correct = (id) => correcting && element("a", { href: `#/edit/${encodeURIComponent(id)}` }, "Correct it");

// What `quality` says is amiss, with the texture beside it; first what is most doubtful where most of it is seen, as in the report.
function drawReview() {
  const ids = block.to_look_at;
  const facades = new Map(block.facades.map((facade) => [facade.id, facade]));
  fill(
    element("h2", {}, `${ids.length} of ${block.facades.length} facades to look at`),
    ids.length ? element("p", {}, "Of each something is amiss beside an assumed height: the columns quality, floors, levels and occluded.")
      : element("p", {}, "Nothing is amiss but assumed heights. To look at, or to correct, any other: choose it on the ", element("a", { href: "#/map" }, "Map"), "."),
    element("div", { class: "stages" }, ...ids.slice(0, LISTED).map((id) => facades.get(id)).map((facade) =>
      element("figure", {},
        element("a", { href: facadeAddress(facade.id) },
          element("img", { src: picture(facade.id, "texture", block.snapshot), alt: `Texture of facade ${facade.id}`, loading: "lazy" })),
        element("figcaption", {}, element("a", { href: facadeAddress(facade.id) }, facade.id), `, ${facade.street}: ${facade.quality}; `,
          `${said(facade.floors)} floors, ${said(facade.levels)} by the map; ${Math.round(100 * (facade.occluded || 0))} % hidden`,
          facade.corrected ? "; corrected " : " ", correct(facade.id))))),
    ids.length > LISTED ? element("p", {}, `The first ${LISTED} are shown; quality in items.parquet has all.`) : null,
  );
}

async function drawFacade(id) {
  const number = block.facades.findIndex((facade) => facade.id === id);
  if (number < 0) {
    fill(element("p", { class: "failed" }, `There is no facade ${id} in this block.`));
    return;
  }
  const facade = block.facades[number];
  const details = await ask(`api/facade?id=${encodeURIComponent(id)}`);
  const go = (by) => (location.hash = facadeAddress(block.facades[(number + by + block.facades.length) % block.facades.length].id));
  const shownColumns = block.columns.filter((column) => facade[column.name] !== undefined);
  fill(
    element("h2", {}, `Facade ${id}`),
    element(
      "div", { class: "controls" },
      element("button", { type: "button", onclick: () => go(-1) }, "Previous facade"),
      element("button", { type: "button", onclick: () => go(1) }, "Next facade"),
      element("span", {}, `${number + 1} of ${block.facades.length}, ${facade.street}`),
      correct(id),
    ),
    details.reason ? element("p", { class: "failed" }, `Failed: ${details.reason}`) : null,
    facade.status === "waiting" ? element("p", {}, "Not made yet.") : null,
    element("dl", { class: "facts" }, ...shownColumns.map((column) =>
      element("div", { title: column.meaning }, element("dt", {}, column.name), element("dd", {}, said(facade[column.name], column.unit))))),
    facade.changed === undefined ? null : changeMap(facade, details, block.changed_from),
    element("div", { class: "stages" }, ...details.stages.map(({ stage, title }) =>
      element("figure", {},
        element("a", { href: picture(id, stage, details.snapshot), target: "_blank" },
          element("img", { src: picture(id, stage, details.snapshot), alt: `${title} of facade ${id}`, loading: "lazy" })),
        element("figcaption", {}, title)))),
    details.stages.some(({ stage }) => stage === "parse") ? legend(block.parse_colours) : null,
    Object.keys(details.seconds).length
      ? element("p", {}, "Seconds: ", Object.entries(details.seconds).map(([name, value]) => `${name} ${value.toFixed(2)}`).join(", "))
      : null,
  );
}

function drawStreet(street, step) {
  if (!block.viewpoints.length) {
    fill(element("h2", {}, "Streets"), element("p", {}, "This block has no viewpoints: no street sees a wall."));
    return;
  }
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
    oninput: (event) => history.replaceState(null, "", `#/street/${street}/${event.target.value}`) || draw(),
  });
  const choose = element("select", { id: "street", onchange: (event) => (location.hash = `#/street/${event.target.value}/0`) },
    ...withViews.map((i) => element("option", { value: i, selected: i === street }, block.streets[i].name)));
  const shot = (kind, alt, title) => element("figure", { class: "panorama" },
    element("img", { src: `picture/${kind}?viewpoint=${viewpoint}&of=${progress?.snapshot || block.snapshot}`, alt, id: kind }), element("figcaption", {}, title));
  const parts = [
    element("h2", {}, `Street ${block.streets[street].name}`),
    element("div", { class: "controls" }, element("label", { for: "street" }, "Street"), choose,
      element("label", { for: "step" }, `Viewpoint ${step + 1} of ${own.length}`)),
    slider,
    element("div", { class: "split" },
      done
        ? element("div", {}, shot("panorama", `Panorama at viewpoint ${step + 1}`, "What the viewpoint sees, textured"),
            shot("grown", `The street after viewpoint ${step + 1}`, "The atlas after this viewpoint: what it has not reached is pale, what is not the street's is grey"))
        : element("p", {}, "This viewpoint is not textured yet."),
      map(block, { colour: (facade) => STATUS[facade.status], strong: (number) => seen.has(number), here: block.viewpoints[viewpoint].at,
        label: `Map: the ${seen.size} facades that the street has seen so far stand out` })),
  ];
  const kept = document.getElementById("step");
  if (kept && document.activeElement === kept && kept.max === String(own.length - 1)) {
    // the slider stays, so that it keeps the focus and what the finger holds
    kept.setAttribute("aria-valuetext", `viewpoint ${step + 1} of ${own.length}`);
    main.children[1].replaceWith(parts[1]);
    main.children[3].replaceWith(parts[3]);
  } else {
    fill(...parts);
  }
}

async function drawModel() {
  const model = await ask("api/model");
  const { show } = await import("./model.js");
  const canvas = element("canvas", { id: "model", tabindex: 0, role: "img", "aria-label": "The textured block in 3D; keys are told below" });
  const note = element("p", { class: "note", role: "status" });
  let viewer = null;
  const bird = element("button", { type: "button", id: "bird", onclick: () => { viewer?.fly(); canvas.focus(); } }, "Bird's view / street");
  const held = (key, text, label) => element("button", { type: "button", "data-key": key, "aria-label": label }, text);
  const full = element("button", { type: "button", onclick: () => { canvas.parentElement.requestFullscreen?.(); canvas.focus(); } }, "Full screen");
  fill(
    element("div", { class: "model" }, canvas, note,
      element("div", { class: "pad" }, held("KeyW", "\u25b2", "Walk ahead"), held("KeyA", "\u25c0", "Walk to the left"),
        held("KeyS", "\u25bc", "Walk back"), held("KeyD", "\u25b6", "Walk to the right"))),
    element("div", { class: "controls" }, bird, full,
      element("span", {}, "W A S D or arrows walk, Shift faster, Q E or drag look, wheel nearer, B bird's view and back")),
  );
  viewer = await show(canvas, model, (text) => { if (note.textContent !== text) note.textContent = text; });
  canvas.focus({ preventScroll: true });
}

function drawRun() {
  const cell = (text, kind = "") => element("td", { class: kind }, String(text));
  const head = (...names) => element("thead", {}, element("tr", {}, ...names.map((text) => element("th", { scope: "col" }, text))));
  const units = (list) => list.length
    ? element("table", {}, head("Stage", "Unit", "Reason"), element("tbody", {}, ...list.map((unit) =>
        element("tr", {}, cell(unit.stage),
          unit.stage === "facades" ? element("td", {}, element("a", { href: facadeAddress(unit.unit) }, unit.unit)) : cell(unit.unit),
          cell(unit.reason)))))
    : element("p", {}, "Nothing.");
  fill(
    element("h2", {}, sentence(fate(progress))),
    element("table", {}, head("Stage", "Progress", "Done", "Failed", "Stale", "Of"), element("tbody", {}, ...progress.stages.map((stage) =>
      element("tr", {}, cell(stage.name),
        element("td", {}, element("progress", { max: stage.total, value: stage.done + stage.failed, "aria-label": `${stage.name}: ${stage.done + stage.failed} of ${stage.total}` })),
        cell(stage.done, "number"), cell(stage.failed, "number"), cell(stage.stale, "number"), cell(stage.total, "number"))))),
    element("h3", {}, `What failed or was set aside: ${progress.failures.length}`),
    units(progress.failures),
    progress.stale.length ? element("h3", {}, `What is out of date: ${progress.stale.length}`) : null,
    progress.stale.length ? units(progress.stale) : null,
    block.notes.length ? element("h3", {}, "Notes") : null,
    block.notes.length ? element("ul", {}, ...block.notes.map((note) => element("li", {}, note))) : null,
    element("p", {}, `Coordinates: ${block.crs}. Snapshot ${block.snapshot}.`),
  );
}

async function draw(again = false) {
  const address = location.hash || "#/map";
  if (address === shown && !again) return;
  const parts = address.slice(2).split("/").map(decodeURIComponent);
  const moved = shown && shown.split("/")[1] !== parts[0];
  shown = address;
  for (const link of document.querySelectorAll("nav a")) {
    const own = link.getAttribute("href").slice(2);
    if (own === parts[0] || own === { facade: "map", edit: "review" }[parts[0]]) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  try {
    if (parts[0] === "facade") await drawFacade(parts[1]);
    else if (parts[0] === "street") drawStreet(Number(parts[1] || 0), Number(parts[2] || 0));
    else if (parts[0] === "model") await drawModel();
    else if (parts[0] === "run") drawRun();
    else if (parts[0] === "review") drawReview();
    else if (parts[0] === "edit" && correcting) await correcting.draw(block, parts[1], fill);
    else if (parts[0] === "photos" && correcting?.photos) await correcting.photos.draw(block, parts[1], fill);
    else drawMap();
  } catch (error) {
    fill(element("p", { class: "failed" }, error.message));
  }
  const boxes = main.querySelector(".boxes"); // who corrects goes on by keys at once
  if (boxes && !again) boxes.focus({ preventScroll: true });
  else if (moved && !again && parts[0] !== "model") main.focus({ preventScroll: true });
}

// What may be drawn anew under a reader's hands: not a model, photos that are decided, a list in use or a slider that is held.
const calm = () => !shown.startsWith("#/model") && !shown.startsWith("#/photos") && !["step", "filter", "coloured-by", "street"].includes(document.activeElement?.id);

const later = (after) => {
  clearTimeout(timer);
  timer = setTimeout(follow, after);
};

async function follow() {
  try {
    const now = await ask("api/progress");
    const changed = !progress || ["snapshot", "published", "under_way"].some((name) => now[name] !== progress[name]);
    progress = now;
    if (changed) {
      block = await ask("api/block");
      document.title = `${block.block} · Streetloom`;
      document.getElementById("title").textContent = block.block;
      if (correcting && shown.startsWith("#/edit/")) await correcting.renew(block, decodeURIComponent(shown.slice("#/edit/".length)));
      else if (!shown || calm()) await draw(true);
    }
    const units = (name) => now.stages.find((stage) => stage.name === name);
    const facades = units("facades");
    const text = facades ? `${facades.done} of ${facades.total} facades${facades.failed ? `, ${facades.failed} failed` : ""}` : "";
    state.textContent = `${text}${now.ended ? "" : `; ${fate(now)}`}`;
    later(now.ended ? 5 * LOOK_AGAIN_MS : LOOK_AGAIN_MS);
  } catch (error) {
    state.textContent = block ? "The viewer does not answer; is it still running?" : error.message;
    later(LOOK_AGAIN_MS);
  }
}

addEventListener("hashchange", () => block && draw());
addEventListener("keydown", (event) => {
  if (!block || event.target.closest("input, select, textarea") || event.ctrlKey || event.altKey || event.metaKey) return;
  const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  const parts = shown.slice(2).split("/").map(decodeURIComponent);
  if (by && parts[0] === "facade") {
    const number = block.facades.findIndex((facade) => facade.id === parts[1]);
    const next = block.facades[(number + by + block.facades.length) % block.facades.length];
    if (number >= 0) location.hash = facadeAddress(next.id);
  }
});

// Of a block of several there is a way back to the others.
if (/\/blocks\/\d+\/$/.test(location.pathname)) document.querySelector("nav").prepend(element("a", { href: "../../" }, "All blocks"));

// The address with the token is for who corrects; it is kept for this window, and taken out of what the window shows.
async function begin() {
  const [, page, given] = location.hash.split("/");
  if (page === "token") {
    sessionStorage.setItem("token", given);
    history.replaceState(null, "", "#/review");
  }
  const token = sessionStorage.getItem("token");
  if (token) {
    try {
      correcting = await (await import("./correcting.js")).begin(token, () => later(0));
      if (page === "token" && correcting?.photos) history.replaceState(null, "", "#/photos");
    } catch (error) {
      document.getElementById("editing").replaceChildren(element("p", { class: "failed" }, `Nothing can be corrected: ${error.message}`));
    }
  }
  await follow();
}
begin();
