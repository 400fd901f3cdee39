// The page with the map of all blocks: what colours facades, what is looked for, and the list of facades that are shown.

import { STATES } from "./city.js";
import { byEvidence, choices, colouring, columnLabel, said } from "./columns.js";
import { blockBase, element, legend, picture, visible } from "./elements.js";
import { boxOf, unite } from "./geometry.js";
import { BlockMap } from "./map.js";

const LISTED = 1000;
const THUMBNAIL_PX = 40;
const TYPED_MS = 300;
const AGAIN_MS = 10_000;

export class MapPage {
  // open: called with (block number, facade id), to open its page; address: of that page.
  constructor(city, { open, address }) {
    Object.assign(this, { city, address, column: "evidence", changedOnly: false, aim: null, wanted: [] });
    this.scheme = { of: () => STATES.waiting[0], legend: [] };
    this.map = new BlockMap({
      label: "Map of the blocks and their facades; the list names the facades. Arrows pan, plus and minus zoom, 0 shows all, Shift with arrows turns and tilts",
      choose: open, view: (numbers) => this.look(numbers), colour: (facade) => this.scheme.of(facade),
      strong: (index, number) => !this.changedOnly || this.changed(number, index),
    });
    this.select = element("select", { id: "coloured-by", onchange: () => this.colourBy(this.select.value) });
    this.filter = element("input", { id: "filter", type: "search", placeholder: "street, building, facade, block", autocomplete: "off", oninput: () => this.typed() });
    this.only = element("input", { id: "changed-only", type: "checkbox", onchange: () => this.showChanged() });
    this.onlyLabel = element("span", { hidden: true }, this.only, element("label", { for: "changed-only" }, " changed between two captures"));
    this.count = element("span", { role: "status", id: "count" });
    this.legend = element("div", {});
    this.hits = element("ul", { class: "hits", hidden: true });
    this.rows = element("tbody");
    this.heads = [0, 1, 2].map(() => element("th", { scope: "col" }));
    this.element = element("div", { class: "map-page" },
      element("h2", { class: "unseen" }, "Map"),
      element("div", { class: "controls" }, element("label", { for: "coloured-by" }, "Colour by"), this.select, element("label", { for: "filter" }, "Find"), this.filter, this.onlyLabel, this.count),
      element("div", { class: "split" },
        element("div", {}, this.map.element, this.legend),
        element("div", {}, this.hits,
          element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "What is shown" },
            element("table", {}, element("thead", {}, element("tr", {}, ...this.heads)), this.rows)))));
    this.later = new Map(); // number -> when a map that could not be read is asked for again
  }

  get columns() {
    return this.maps().at(0)?.[1].columns || [];
  }

  // What is drawn: [[number, map of the block]].
  maps() {
    return [...this.map.details].map(([number, { block }]) => [number, block]);
  }

  changed(number, index) {
    const { block } = this.map.details.get(number) || {};
    return block !== undefined && block.facades[index].changed >= block.changed_from;
  }

  // The list of blocks was read anew.
  update() {
    this.map.setBlocks(this.city.blocks.map((block) => ({ ...block, name: this.city.called(block.number) })));
    this.fetchMaps();
    this.refresh();
  }

  // Another part of the map is shown, with the facades of some blocks.
  look(numbers) {
    const same = String(numbers) === String(this.wanted);
    this.wanted = numbers;
    this.fetchMaps();
    if (!same) this.refresh();
  }

  // Fetch the maps of blocks that are shown and are not drawn, or not as they are now.
  fetchMaps() {
    for (const number of this.wanted) {
      const { published, state } = this.city.block(number) || {};
      if ((!published && state !== "running" && !this.city.single) || performance.now() < (this.later.get(number) || 0)) continue; // there is no map yet
      const shown = this.map.details.get(number)?.block;
      if (shown && !this.city.stale(number) && shown === this.city.here(number)) continue;
      this.city.load(number).then((block) => this.take(number, block), (error) => this.failed(number, error));
    }
  }

  take(number, block) {
    if (!this.wanted.includes(number) || this.map.details.get(number)?.block === block) return;
    const [east, north] = this.city.said.origin;
    this.map.setDetail(number, block, [block.origin[0] - east, block.origin[1] - north]);
    this.fillChoices();
    this.rescheme();
    if (this.aim && this.aim.blocks.includes(number)) this.markAim();
    if (this.filter.value.trim()) this.markFound();
  }

  failed(number, error) {
    this.later.set(number, performance.now() + AGAIN_MS);
    if (this.city.block(number)?.published) this.count.textContent = visible(error.message);
  }

  fillChoices() {
    if (this.select.options.length) return;
    const [common, more] = choices(this.columns);
    const option = ({ name, label }) => element("option", { value: name, selected: name === this.column }, label);
    this.select.replaceChildren(...common.map(option), element("optgroup", { label: "more" }, ...more.map(option)));
  }

  colourBy(name) {
    this.column = name;
    this.select.value = name;
    this.rescheme();
  }

  // Colours of what is drawn: blocks that come add values, so that classes change.
  rescheme() {
    const facades = this.maps().flatMap(([, block]) => block.facades);
    this.scheme = colouring(this.column, facades, this.columns);
    this.onlyLabel.hidden = !facades.some((facade) => facade.changed !== undefined);
    this.map.renew();
    this.refresh();
  }

  showChanged() {
    this.changedOnly = this.only.checked;
    this.colourBy(this.changedOnly ? "changed" : this.column);
  }

  refresh() {
    const states = Object.entries(STATES).map(([state, [colour, text]]) => [colour, text, this.city.blocks.filter((block) => block.state === state).length]).filter(([, , count]) => count);
    const detailed = this.maps().length > 0;
    const parts = [];
    if (!this.city.single) parts.push(element("div", { class: "legend-row" }, element("span", {}, "Blocks:"), legend(states.map(([colour, text, count]) => [colour, `${count} ${text}`]))));
    if (detailed) parts.push(element("div", { class: "legend-row" }, element("span", {}, `Facades by ${columnLabel(this.column, this.columns).toLowerCase()}:`), legend(this.scheme.legend)));
    this.legend.replaceChildren(...parts);
    this.heads.forEach((head, i) => { head.textContent = (detailed || this.city.single ? ["Facade", "Street", columnLabel(this.column, this.columns)] : ["Block", "State", "Facades"])[i]; });
    this.list();
  }

  matching() {
    const wanted = this.filter.value.trim().toLowerCase();
    return this.maps().flatMap(([number, block]) => block.facades
      .filter((facade, index) => !this.changedOnly || this.changed(number, index))
      .filter((f) => !wanted || [f.id, f.street, f.status, f.building].some((text) => text.toLowerCase().includes(wanted)))
      .map((facade) => ({ number, block, facade })));
  }

  // Facades that are drawn, or blocks where none is.
  list() {
    if (!this.maps().length && !this.city.single) {
      this.listBlocks();
      return;
    }
    const found = this.matching();
    if (this.changedOnly) found.sort((a, b) => b.facade.changed - a.facade.changed);
    else if (this.column === "evidence") found.sort((a, b) => byEvidence(a.facade) - byEvidence(b.facade));
    const { unit, words } = this.columns.find(({ name }) => name === this.column) || {};
    const focused = this.rows.contains(document.activeElement) ? document.activeElement.getAttribute("href") : null;
    this.rows.replaceChildren(...found.slice(0, LISTED).map(({ number, block, facade }) => element("tr", {},
      element("td", {}, element("a", { href: this.address(number, facade.id) }, this.thumbnail(number, block, facade), facade.id)), element("td", {}, facade.street),
      element("td", { class: typeof facade[this.column] === "number" ? "number" : "" }, said(facade[this.column], unit, words)))));
    if (focused) [...this.rows.querySelectorAll("a")].find((link) => link.getAttribute("href") === focused)?.focus();
    const all = this.maps().reduce((sum, [, block]) => sum + block.facades.length, 0);
    this.count.textContent = `${found.length} of ${all} facades${this.city.single ? "" : " shown"}${found.length > LISTED ? `, the first ${LISTED} listed` : ""}`;
  }

  thumbnail(number, { snapshot }, { id, status }) {
    if (status !== "done") return null;
    return element("img", { class: "thumbnail", src: picture(id, "texture", snapshot, 2 * THUMBNAIL_PX, blockBase(number, this.city.single)), alt: "", loading: "lazy", height: THUMBNAIL_PX });
  }

  listBlocks() {
    const wanted = this.filter.value.trim().toLowerCase();
    const found = this.city.blocks.filter(({ number, name, state }) => [this.city.called(number), name, state].some((text) => text.toLowerCase().includes(wanted)));
    this.rows.replaceChildren(...found.slice(0, LISTED).map(({ number, state, facades }) => element("tr", {},
      element("td", {}, element("a", { href: `#/map/${number}` }, this.city.called(number))), element("td", {}, STATES[state][1]), element("td", { class: "number" }, String(facades)))));
    this.count.textContent = `${this.city.blocks.length} blocks; zoom in for their facades`;
  }

  typed() {
    clearTimeout(this.timer);
    this.aim = null;
    this.list();
    this.timer = setTimeout(() => this.search(), TYPED_MS);
  }

  // Look for what is written, in the whole city; what is found is marked, and the map goes there.
  async search() {
    const text = this.filter.value.trim();
    if (!text) {
      this.hits.hidden = true;
      this.map.mark([]);
      return;
    }
    if (this.city.single) {
      const boxes = this.markFound();
      if (boxes.length) this.map.goTo(unite(boxes));
      return;
    }
    const { found } = await this.city.find(text).catch((error) => ({ found: [], error }));
    if (this.filter.value.trim() !== text) return;
    this.hits.hidden = false;
    this.hits.replaceChildren(...(found.length ? found.map((hit) => element("li", {}, element("button", { type: "button", onclick: () => this.goTo(hit) }, this.hitName(hit)))) : [element("li", {}, "Nothing of that name is published.")]));
    const [best] = found;
    if (best) this.goTo(best);
    else this.markFound();
  }

  hitName({ kind, id, blocks }) {
    const where = kind === "block" ? "" : `, ${blocks.slice(0, 2).map((number) => this.city.called(number)).join("; ")}${blocks.length > 2 ? " …" : ""}`;
    return `${kind === "block" ? this.city.called(blocks[0]) : id} (${kind}${where})`;
  }

  // Go to something that was found, or to a facade of a block, and mark it there once its block is here.
  goTo(hit) {
    this.aim = hit;
    if (hit.box.length) this.map.goTo(hit.box);
    this.markAim();
  }

  // Box of a block on the map, y up; empty where its place is not known.
  boxOfBlock(number) {
    const outline = this.city.block(number)?.outline || [];
    return outline.length ? boxOf(outline) : [];
  }

  async goToFacade(number, id) {
    const block = await this.city.load(number);
    const facade = block.facades.find((one) => one.id === id);
    if (!facade) throw new Error(`There is no facade ${id} in ${this.city.called(number)}.`);
    this.goTo({ kind: "facade", id, blocks: [number], box: boxOf(facade.line.map((point) => this.placed(block, point))) });
  }

  placed(block, [x, y]) {
    const [east, north] = this.city.said.origin;
    return [x + block.origin[0] - east, y + block.origin[1] - north];
  }

  markAim() {
    const { kind, id, blocks, box } = this.aim;
    if (kind === "block") {
      this.map.mark(blocks.map((number) => ({ points: this.city.block(number)?.outline || [], closed: true })).filter(({ points }) => points.length));
      return;
    }
    const marks = this.maps().filter(([number]) => blocks.includes(number)).flatMap(([, block]) => this.marks(block, kind, id));
    this.map.mark(marks.length || !box.length ? marks : [{ points: [[box[0], box[1]], [box[2], box[1]], [box[2], box[3]], [box[0], box[3]]], closed: true }]);
  }

  // What of a block is marked: a street's line, a building's outline, a facade.
  marks(block, kind, id) {
    const at = (points) => points.map((point) => this.placed(block, point));
    if (kind === "street") return block.streets.filter(({ name }) => name === id).map(({ line }) => ({ points: at(line) }));
    if (kind === "building") return block.buildings.filter((one) => one.id === id).flatMap(({ rings }) => rings.map((points) => ({ points: at(points), closed: true })));
    return block.facades.filter((one) => one.id === id).map(({ line }) => ({ points: at(line) }));
  }

  // Mark the facades of the list; returns their boxes.
  markFound() {
    const marks = this.matching().map(({ block, facade }) => ({ points: facade.line.map((point) => this.placed(block, point)) }));
    this.map.mark(marks);
    return marks.map(({ points }) => boxOf(points));
  }
}
