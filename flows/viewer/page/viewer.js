// The viewer's page. Addresses: #/map, #/map/BLOCK, #/map/BLOCK/ID, #/model, #/model/BLOCK/ID, #/blocks; of a block, with #/block/BLOCK/ before them
// where there are several: elevations, review, facade/ID, street/NUMBER/STEP, run; for who corrects edit/ID and photos/NAME.

import { ask, blockBase, blockPage, element, facadeAddress, isStatic, openBlock, openNumber, visible } from "./elements.js";
import { blocksPage, facadePage, fate, reviewPage, runPage, streetPage } from "./block_pages.js";
import { City } from "./city.js";
import { elevationsPage } from "./elevations.js";

const main = document.getElementById("main");
const state = document.getElementById("state");
const LOOK_AGAIN_MS = 2000;
const OF_CITY = ["map", "model", "blocks", "token", ""];

const city = new City();
let mapPage = null; // once it was looked at: its engine is large
let model = null; // the view of the 3D page
let block = null; // map of the open block
let progress = null; // what its /api/progress said last
let shown = ""; // the address that is drawn
const correctors = new Map(); // block -> who corrects it, for who may
let token = null;
let begun = false; // the list of blocks was read
let timer = 0;

// What puts parts on the page, as long as the address is the one that is shown: a slow page does not come over a later one.
const filler = (address) => (...parts) => {
  if (shown === address) main.replaceChildren(...parts.filter((part) => part !== null));
};
const corrector = () => correctors.get(openNumber()) || null;
const correct = (id) => corrector() && element("a", { href: blockPage(`edit/${encodeURIComponent(id)}`) }, "Correct it");

// {number, page, rest} of an address; number is null of a page of the whole city.
function parse(address) {
  const parts = address.slice(2).split("/").map(decodeURIComponent);
  if (parts[0] === "block") return { number: Number(parts[1]), page: parts[2] || "run", rest: parts.slice(3) };
  return { number: city.single && !OF_CITY.includes(parts[0]) ? 0 : null, page: parts[0] || "map", rest: parts.slice(1) };
}

function drawNavigation({ page }) {
  const link = (href, text, names) => element("a", { href, "aria-current": names.includes(page) ? "page" : null }, text);
  const ofBlock = city.single || block;
  const review = link(blockPage("review"), "To look at", ["review", "edit"]);
  const streets = isStatic ? "" : link(blockPage("street"), "Streets", ["street"]); // its pictures are drawn when they are asked for
  const elevations = link(blockPage("elevations"), "Elevations", ["elevations"]);
  const run = link(blockPage("run"), "Run", ["run"]);
  const facade = city.single ? ["facade"] : [];
  const parts = [link("#/map", "Map", ["map", ...facade]), link("#/model", "3D", ["model"])];
  const photos = corrector()?.photos ? [link(blockPage("photos"), "Photos", ["photos"])] : [];
  if (city.single) parts.splice(1, 0, elevations, review, streets);
  else parts.push(link("#/blocks", "Blocks", ["blocks"]));
  document.getElementById("pages").replaceChildren(...parts, ...(city.single ? [run, ...photos] : []));
  const own = document.getElementById("block-pages");
  own.hidden = city.single || !ofBlock;
  if (!own.hidden) own.replaceChildren(element("span", {}, city.called(openNumber())), elevations, review, streets, run);
}

// The open block is another one from now on.
async function openPages(number) {
  if (block && openNumber() === number) return;
  const row = city.block(number);
  if (!row) throw new Error(`There is no block ${number}.`);
  openBlock(number, city.single);
  [block, progress] = [null, null];
  const [map, now] = await Promise.all([city.load(number), ask("api/progress")]);
  if (openNumber() !== number) return; // another was opened meanwhile
  [block, progress] = [map, now];
  document.getElementById("editing").replaceChildren();
  if (token) await openCorrector(number);
}

async function openCorrector(number) {
  try {
    if (!correctors.has(number)) correctors.set(number, await (await import("./correcting.js")).begin(token, () => later(0)));
    correctors.get(number)?.attach();
  } catch (error) {
    document.getElementById("editing").replaceChildren(element("p", { class: "failed" }, `Nothing can be corrected: ${error.message}`));
  }
}

async function drawMap([number, id], fill) {
  const { MapPage } = await import("./map_page.js");
  if (!mapPage) {
    mapPage = new MapPage(city, { open: (number, id) => (location.hash = addressOf(number, id)), address: addressOf });
    mapPage.update();
  }
  fill(mapPage.element);
  if (id !== undefined) await mapPage.goToFacade(Number(number), id);
  else if (number !== undefined) mapPage.goTo({ kind: "block", id: number, blocks: [Number(number)], box: mapPage.boxOfBlock(Number(number)) });
}

async function drawStreet(street, step, fill) {
  const { smallMap } = await import("./map.js");
  const parts = streetPage(block, progress, street, step, () => draw(), smallMap);
  const kept = document.getElementById("step");
  if (kept && document.activeElement === kept && parts[2] && kept.max === String(parts[2].max)) {
    // the slider stays, so that it keeps the focus and what the finger holds
    kept.setAttribute("aria-valuetext", parts[2].getAttribute("aria-valuetext"));
    main.children[1].replaceWith(parts[1]);
    main.children[3].replaceWith(parts[3]);
  } else fill(...parts);
}

async function drawModel([number, id], fill) {
  const { modelPage } = await import("./model_page.js");
  model = await modelPage(city, mapPage?.map.middle() ?? [0, 0], id === undefined ? null : [Number(number), id], fill, (number, id) => (location.hash = addressOf(number, id)));
}

const addressOf = (number, id) => (city.single ? facadeAddress(id) : `#/block/${number}/facade/${encodeURIComponent(id)}`);

async function draw(again = false) {
  const address = location.hash || "#/map";
  if (address === shown && !again) return;
  const place = parse(address);
  const moved = shown && parse(shown).page !== place.page;
  shown = address;
  const fill = filler(address);
  try {
    if (place.number !== null) await openPages(place.number);
    if (shown !== address) return;
    drawNavigation(place);
    const { page, rest } = place;
    if (page === "facade") fill(...(await facadePage(block, rest[0], openNumber(), correct)));
    else if (page === "street") await drawStreet(Number(rest[0] || 0), Number(rest[1] || 0), fill);
    else if (page === "elevations") fill(...elevationsPage(block, Number(rest[0]) || undefined));
    else if (page === "run") fill(...runPage(block, progress));
    else if (page === "review") fill(...reviewPage(block, correct));
    else if (page === "edit" && corrector()) await corrector().draw(block, rest[0], fill);
    else if (page === "photos" && corrector()?.photos) await corrector().photos.draw(block, rest[0], fill);
    else if (page === "model") await drawModel(rest, fill);
    else if (page === "blocks" && !city.single) fill(...blocksPage(city, token ? "review" : "run"));
    else await drawMap(page === "map" ? rest : [], fill);
  } catch (error) {
    if (shown !== address) return;
    drawNavigation(place);
    fill(element("p", { class: "failed" }, error.message));
  }
  if (shown !== address) return;
  const boxes = main.querySelector(".boxes"); // who corrects goes on by keys at once
  if (boxes && !again) boxes.focus({ preventScroll: true });
  else if (moved && !again && place.page !== "model") main.focus({ preventScroll: true });
}

// What may be drawn anew under a reader's hands: not a map or a model, a facade or photos that are corrected, a list in use or a
// slider that is held.
const calm = () => !["map", "model", "photos", "edit"].includes(parse(shown).page) && !["step", "street"].includes(document.activeElement?.id);

const later = (after) => {
  clearTimeout(timer);
  if (!isStatic) timer = setTimeout(follow, after);
};

// Read anew what goes on: the list of blocks, and of the open one its progress and its map.
async function follow() {
  try {
    const changed = await city.refresh();
    if (!begun) openBlock(0, city.single);
    begun = true;
    const blockChanged = await followBlock();
    if (changed) model?.tiles.update();
    if (changed || blockChanged) mapPage?.update();
    else mapPage?.fetchMaps();
    // a run opens with the photos that are to be decided, or with what is to be looked at
    if (byToken && !shown) history.replaceState(null, "", !city.single ? "#/map" : corrector()?.photos ? "#/photos" : "#/review");
    document.title = `${visible(city.said.name)} · Streetloom`;
    document.getElementById("title").textContent = visible(city.said.name);
    if (blockChanged && corrector() && parse(shown).page === "edit") await corrector().renew(block, parse(shown).rest[0]);
    else if (!shown) await draw();
    else if ((changed || blockChanged) && calm()) await draw(true);
    state.textContent = city.single ? blockNews() : cityNews();
    later(city.single && progress?.ended ? 5 * LOOK_AGAIN_MS : LOOK_AGAIN_MS);
  } catch (error) {
    state.textContent = city.said ? "The viewer does not answer; is it still running?" : visible(error.message);
    later(LOOK_AGAIN_MS);
  }
}

// Whether the open block has changed.
async function followBlock() {
  if (!block && !city.single) return false;
  const number = openNumber();
  const now = await ask("api/progress", blockBase(number, city.single));
  if (number !== openNumber()) return false;
  const changed = !progress || ["snapshot", "published", "under_way"].some((name) => now[name] !== progress[name]);
  progress = now;
  if (changed || !block) {
    city.forget(number);
    block = await city.load(number);
    if (token && !correctors.has(number)) await openCorrector(number);
  }
  return changed;
}

function blockNews() {
  const facades = progress.stages.find((stage) => stage.name === "facades");
  const text = facades ? `${facades.done} of ${facades.total} facades${facades.failed ? `, ${facades.failed} failed` : ""}` : "";
  return `${text}${progress.ended ? "" : `; ${fate(progress)}`}`;
}

function cityNews() {
  const count = (name) => city.blocks.filter((one) => one.state === name).length;
  const parts = [`${count("done")} of ${city.blocks.length} blocks`, ...["running", "failed", "stale", "waiting"].filter(count).map((name) => `${count(name)} ${name === "stale" ? "out of date" : name}`)];
  return parts.join(", ");
}

addEventListener("hashchange", () => begun && draw());
addEventListener("keydown", (event) => {
  if (!block || event.target.closest("input, select, textarea, .map") || event.ctrlKey || event.altKey || event.metaKey) return;
  const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  const { page, rest } = parse(shown);
  if (by && page === "facade") {
    const index = block.facades.findIndex((facade) => facade.id === rest[0]);
    const next = block.facades[(index + by + block.facades.length) % block.facades.length];
    if (index >= 0) location.hash = facadeAddress(next.id);
  }
});

// The address with the token is for who corrects; it is kept for this window, and taken out of what the window shows.
const [, first, given] = location.hash.split("/");
const byToken = first === "token";
if (byToken) {
  sessionStorage.setItem("token", given);
  history.replaceState(null, "", "./");
}
token = sessionStorage.getItem("token");
await follow();
