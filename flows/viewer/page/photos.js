// Deciding which walls photos show, those that `streetloom match` left to a person first: #/photos/NAME.

import { Steps } from "./boxes.js";
import { ask, blockPage, element, facadeAddress, picture, visible } from "./elements.js";
import { smallMap } from "./map.js";

// Metres around a photo's place that its map shows, and walls near it that it may show though they are no candidates.
const AROUND_M = 35;
const NEAR = 60;
const COLOURS = ["#0072b2", "#d55e00", "#009e73"];
const QUIET = "#8b949c";
// What a wall is shown by, the first that it has.
const BY = [["rectified", "as photographed"], ["texture", "as textured: made up where no picture showed it"]];
const NONE = { facade: "", decided: true };
export const photoAddress = (name) => blockPage(`photos/${encodeURIComponent(name)}`);

export class Photos {
  constructor(told) {
    this.told = told;
    this.rows = null; // what /edit/matches said, those left to a person first
    this.steps = new Steps({}); // photo -> {facade, decided}
    this.pictures = new Map(); // what is shown of photos and walls, by address
    const link = element("a", { href: "#/photos" }, "Photos");
    document.querySelector("nav").append(link);
  }

  // Those whose decision is not kept yet.
  unsaved() {
    return (this.rows || []).filter((row) => {
      const { facade, decided } = this.steps.now[row.photo];
      return facade !== row.facade || decided !== Boolean(row.by);
    });
  }

  dirty() {
    return this.unsaved().length > 0;
  }

  stands(rows) {
    const open = new Set(this.unsaved().map(({ photo }) => photo));
    const known = new Map((this.rows || []).map((row) => [row.photo, row]));
    const before = this.rows && new Map(this.rows.map((row, number) => [row.photo, number]));
    const asked = (row) => (before ? before.get(row.photo) ?? rows.length : row.facade ? 2 : row.by ? 1 : 0);
    this.rows = rows.map((row) => ({ ...row, best: row.candidates[0]?.probability ?? 0 })).sort((a, b) => asked(a) - asked(b) || (before ? 0 : b.best - a.best));
    // what somebody else decided meanwhile stands here too, whatever is undone: it would be saved over as one's own
    for (const { photo, facade, by } of this.rows) {
      const old = known.get(photo);
      if (open.has(photo) || (old && old.facade === facade && old.by === by)) continue;
      const stood = { facade, decided: Boolean(by) };
      for (const state of [this.steps.now, ...this.steps.past, ...this.steps.future]) state[photo] = stood;
    }
  }

  left(row) {
    const { facade, decided } = this.steps.now[row.photo];
    return !facade && !decided;
  }

  async draw(block, name, fill) {
    this.block = block;
    if (!this.rows) this.stands((await this.told("edit/matches")).photos);
    if (!this.rows.length) {
      fill(element("h2", {}, "Photos"), element("p", {}, "The table has no photo."));
      return;
    }
    const row = name === undefined ? this.rows.find((one) => this.left(one)) || this.rows[0] : this.rows.find((one) => one.photo === name);
    if (!row) throw new Error(`There is no photo ${name} in the table.`);
    this.row = row;
    fill(this.made(row));
    this.changed();
    if (!this.section.contains(document.activeElement)) this.section.focus({ preventScroll: true });
    await Promise.all([this.pictured(row), ...row.candidates.map((one, number) => this.wall(one.id, number))]);
  }

  button(id, text, act, keys) {
    return element("button", { type: "button", id, onclick: act, "aria-keyshortcuts": keys }, text);
  }

  made(row) {
    this.undo = this.button("undo", "Undo", () => this.step("undo"), "Control+Z");
    this.again = this.button("redo", "Redo", () => this.step("redo"), "Control+Y");
    this.keep = this.button("save", "Save", () => this.save(), "Control+S");
    this.told_ = element("p", { role: "status", id: "left" });
    this.result ??= element("p", { role: "status", id: "saved" });
    this.image = element("img", { id: "photo", alt: `Photo ${row.photo}` });
    this.map = element("div", {});
    this.choices = row.candidates.map((one, number) => this.choice(one, number));
    this.none = element("input", { type: "radio", name: "wall", id: "none", onchange: () => this.decide(NONE), "aria-keyshortcuts": "0" });
    this.other = element("select", { id: "other", onchange: () => this.other.value && this.decide({ facade: this.other.value, decided: true }) },
      element("option", { value: "" }, "choose, here or on the map"), ...this.near(row).map((facade) => element("option", { value: facade.id }, `${facade.id}, ${facade.street}`)));
    this.list = element("tbody");
    this.section = element("section", { class: "photos", tabindex: -1, onkeydown: (event) => this.key(event) },
      element("h2", {}, `Photo ${row.photo}`), this.told_,
      element("div", { class: "controls" }, this.button("previous", "Previous", () => this.go(-1), "P"), this.button("next", "Next", () => this.go(1), "N"),
        this.undo, this.again, this.keep),
      this.result,
      element("div", { class: "split" }, element("figure", {}, this.image, element("figcaption", {}, "The wall in its middle is looked for")), this.map),
      element("fieldset", {}, element("legend", {}, "Which wall does it show?"),
        row.candidates.length ? null : element("p", {}, "No wall of the block is likely: its place or its heading may be wrong."),
        element("div", { class: "candidates" }, ...this.choices.map(({ part }) => part)),
        element("p", { class: "field" }, this.none, element("label", { for: "none" }, "0: none of these, nor another of the block")),
        element("p", { class: "field" }, element("label", { for: "other" }, "Another wall"), this.other)),
      element("p", { class: "keys" }, `Keys: ${row.candidates.length ? `1 to ${row.candidates.length} choose, ` : ""}0 none, N and P the next and the previous photo, Ctrl Z and Ctrl Y, Ctrl S saves.`),
      element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Photos" },
        element("table", {}, element("thead", {}, element("tr", {}, ...["Photo", "Wall", "How"].map((text) => element("th", { scope: "col" }, text)))), this.list)));
    return this.section;
  }

  choice(one, number) {
    const facade = this.block.facades.find(({ id }) => id === one.id);
    const input = element("input", {
      type: "radio", name: "wall", id: `wall-${number}`, onchange: () => this.decide({ facade: one.id, decided: true }), "aria-keyshortcuts": number + 1, disabled: !facade,
    });
    const image = element("img", { alt: "", hidden: true });
    const how = element("span", { class: "how" });
    const part = element("label", { class: "candidate", for: input.id },
      element("span", { class: "field" }, input, element("strong", { class: `of-${number}` }, `${number + 1}: ${one.id}`), ` ${Math.round(100 * one.probability)} %`),
      image, how, element("span", {}, facade ? `${facade.street}. ` : "The run has no such wall. ", one.why ? `${one.why[0].toUpperCase()}${one.why.slice(1)}.` : ""));
    return { id: one.id, input, image, how, part };
  }

  at(row) {
    return row.place && [row.place[0] - this.block.origin[0], row.place[1] - this.block.origin[1]];
  }

  // Walls that it might show beside the candidates, the nearest first.
  near(row) {
    const at = this.at(row);
    const known = new Set(row.candidates.map(({ id }) => id));
    const far = ({ line: [[x1, y1], [x2, y2]] }) => (at ? Math.hypot((x1 + x2) / 2 - at[0], (y1 + y2) / 2 - at[1]) : 0);
    const others = this.block.facades.filter(({ id }) => !known.has(id)).sort((a, b) => far(a) - far(b));
    const { facade } = this.steps.now[row.photo];
    return others.filter(({ id }, number) => number < NEAR || id === facade);
  }

  drawMap() {
    const { row } = this;
    const at = this.at(row);
    const { facade: chosen } = this.steps.now[row.photo];
    const numbers = new Map(row.candidates.map(({ id }, number) => [id, number]));
    const points = [...(at ? [at] : []), ...this.block.facades.filter(({ id }) => numbers.has(id) || id === chosen).flatMap(({ line }) => line)];
    const corner = (pick, by) => [0, 1].map((axis) => pick(...points.map((point) => point[axis])) + by);
    const within = points.length ? [corner(Math.min, -AROUND_M / 2), corner(Math.max, AROUND_M / 2)] : null;
    this.map.replaceChildren(smallMap(this.block, {
      colour: ({ id }) => (id === chosen ? "#1c7a43" : COLOURS[numbers.get(id)] || QUIET), here: at, heading: row.heading, within,
      called: ({ id }) => (numbers.has(id) ? String(numbers.get(id) + 1) : id === chosen ? "✓" : null),
      choose: (facade) => this.decide({ facade, decided: true }),
      label: at ? "Map: where the photo was taken, and the walls that it may show, by number; a click chooses a wall" : "Map of the walls that the photo may show; a click chooses a wall",
    }));
  }

  // Pictures are asked for with the token, which an address would give away.
  async pictured(row) {
    const { image } = this;
    try {
      image.src = await this.shown(`photo ${row.photo}`, async () => {
        const blob = await this.told(`edit/photo?name=${encodeURIComponent(row.photo)}`);
        const reader = new FileReader();
        await new Promise((done) => { reader.onload = done; reader.readAsDataURL(blob); });
        return reader.result;
      });
    } catch (error) {
      image.replaceWith(element("p", { class: "failed" }, error.message));
    }
  }

  async wall(id, number) {
    const { image, how } = this.choices[number];
    const found = await this.shown(`wall ${id}`, async () => {
      const { stages, snapshot } = await ask(`api/facade?id=${encodeURIComponent(id)}`);
      const [by] = BY.filter(([name]) => stages.some(({ stage }) => stage === name));
      return by ? [picture(id, by[0], snapshot), by[1]] : null;
    }).catch(() => null);
    if (found) [image.src, how.textContent] = found;
    else how.textContent = "no picture of it yet";
    image.hidden = !found;
  }

  async shown(key, make) {
    if (!this.pictures.has(key)) {
      if (this.pictures.size > 40) this.pictures.clear();
      this.pictures.set(key, make());
      this.pictures.get(key).catch(() => this.pictures.delete(key));
    }
    return this.pictures.get(key);
  }

  decide(decision) {
    const before = this.steps.now[this.row.photo];
    if (before.facade !== decision.facade || before.decided !== decision.decided) this.steps.take({ ...this.steps.now, [this.row.photo]: decision });
    this.changed();
  }

  step(way) {
    const before = this.steps.now;
    this.steps[way]();
    const other = Object.keys(this.steps.now).find((photo) => this.steps.now[photo] !== before[photo]);
    if (other && other !== this.row.photo) location.hash = photoAddress(other); // what is undone is looked at
    else this.changed();
  }

  go(by) {
    const number = this.rows.indexOf(this.row);
    location.hash = photoAddress(this.rows[(number + by + this.rows.length) % this.rows.length].photo);
  }

  key(event) {
    if (event.altKey) return;
    const chord = event.ctrlKey || event.metaKey;
    if (!chord && event.target.closest("select")) return;
    const chosen = this.row.candidates[Number(event.key) - 1];
    const keys = chord
      ? { s: () => this.save(), z: () => this.step(event.shiftKey ? "redo" : "undo"), y: () => this.step("redo") }
      : { 0: () => this.decide(NONE), n: () => this.go(1), p: () => this.go(-1) };
    const act = !chord && chosen ? () => !this.choices[Number(event.key) - 1].input.disabled && this.decide({ facade: chosen.id, decided: true }) : keys[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act();
  }

  how(row) {
    const { facade, decided } = this.steps.now[row.photo];
    const said = decided ? (row.by && facade === row.facade ? `decided by ${row.by}` : "decided") : facade ? "sure, or named in the table" : "left to you";
    return this.unsaved().includes(row) ? `${said}, not saved` : said;
  }

  changed() {
    const { row } = this;
    const { facade, decided } = this.steps.now[row.photo];
    for (const { id, input, part } of this.choices) {
      input.checked = id === facade;
      part.classList.toggle("chosen", id === facade);
    }
    this.none.checked = decided && !facade;
    this.other.value = this.choices.some(({ id }) => id === facade) ? "" : facade;
    if (this.other.selectedIndex < 0) this.other.value = "";
    this.undo.disabled = !this.steps.past.length;
    this.again.disabled = !this.steps.future.length;
    const left = this.rows.filter((one) => this.left(one)).length;
    const named = this.rows.filter((one) => this.steps.now[one.photo].facade).length;
    this.keep.textContent = `Save, and take ${named} photo${named === 1 ? "" : "s"}`;
    this.keep.disabled = !this.dirty() && (!named || this.taken);
    this.told_.textContent = `${visible(this.how(row))}; photo ${this.rows.indexOf(row) + 1} of ${this.rows.length}, ${left} left to you`;
    this.list.replaceChildren(...this.rows.map((one) => element("tr", { "aria-current": one === row ? "true" : null },
      element("td", {}, element("a", { href: photoAddress(one.photo) }, one.photo)),
      element("td", {}, this.steps.now[one.photo].facade ? element("a", { href: facadeAddress(this.steps.now[one.photo].facade) }, this.steps.now[one.photo].facade) : "–"),
      element("td", {}, this.how(one)))));
    this.drawMap();
  }

  async save() {
    if (this.keep.disabled) return;
    const decisions = this.unsaved().map((row) => ({ photo: row.photo, ...this.steps.now[row.photo], stood: [row.facade, row.by] }));
    this.keep.disabled = true;
    try {
      const done = await this.told("edit/decisions", { decisions });
      this.taken = true;
      const name = this.row.photo;
      this.stands(done.photos);
      this.row = this.rows.find((row) => row.photo === name) || this.rows[0];
      this.say([done.said, ...done.notes].join("; "), false);
    } catch (error) {
      this.say(error.message, true);
    }
    this.changed();
  }

  say(text, failed) {
    this.result.textContent = visible(text);
    this.result.classList.toggle("failed", failed);
  }
}
