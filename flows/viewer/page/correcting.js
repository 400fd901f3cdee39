// Correcting facades of a block, for who opened the viewer by the address with its token: #/edit/ID, and "Run now" on every page
// of the block; and #/photos where it was given photos.

import { Completions } from "./completions.js";
import { Editor, MASKS } from "./editor.js";
import { said } from "./columns.js";
import { ask, blockPage, element, facadeAddress, legend, openBase, picture, visible } from "./elements.js";
import { Photos } from "./photos.js";

const LOOK_AGAIN_MS = 1000;
// What is chosen of a building, as words and colours: name, and how it is called. Its words /edit/state says.
const WORDS = [["roof_shape", "its roof"], ["roof_material", "roof of"], ["wall_material", "walls of"]];
const COLOURS = [["roof_colour", "roof's colour"], ["wall_colour", "walls' colour"]];
// Numbers: name, the field's id, how it is called, least, most, step.
const NUMBERS = [["levels", "storeys", "storeys", 1, 300, 1], ["height", "height", "its height to the eaves, m", 2, 1000, "any"],
  ["roof_height", "roof_height", "from there to the ridge, m", 0.1, 100, "any"]];
// Stages that have the wall's own size: what elements are drawn on.
const UNDER = ["rectified", "texture", "street", "parse"];
export const editAddress = (id) => blockPage(`edit/${encodeURIComponent(id)}`);

// Null where this viewer lets nobody correct; raises with the reason where the token is not its own. again: looks for news.
export async function begin(token, again) {
  const base = openBase();
  const told = async (path, body) => {
    const answer = await fetch(base + path, {
      method: body === undefined ? "GET" : "POST",
      headers: { "X-Streetloom-Token": token, "Content-Type": "application/json" },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
    if (answer.status === 404) return null;
    if (answer.headers.get("Content-Type") === "image/jpeg") return answer.blob();
    const words = await answer.json();
    if (!answer.ok) throw new Error(words.reason || answer.statusText);
    return words;
  };
  const state = await told("edit/state");
  return state && new Correcting(told, state, again);
}

class Correcting {
  constructor(told, state, again) {
    Object.assign(this, { told, labels: [...state.labels, ...MASKS], words: state.words, who: state.who, kept: state.kept, again });
    this.open = new Map(); // facade -> what is being done there; kept while other pages are looked at
    this.run = element("button", { type: "button", id: "redo-now", onclick: () => this.redo() }, "Run now");
    this.running = element("p", { role: "status", id: "redo-said" });
    this.attach();
    this.photos = state.photos ? new Photos(told) : null;
    addEventListener("beforeunload", (event) => ([...this.open.values()].some((one) => one.dirty()) || this.photos?.dirty()) && event.preventDefault());
    this.follow(state.redo);
  }

  // Show on the page that its block can be corrected.
  attach() {
    document.getElementById("editing").replaceChildren(this.run, this.running);
  }

  async redo() {
    try {
      this.follow(await this.told("edit/redo", {}));
    } catch (error) {
      this.tell(error.message, true);
    }
  }

  tell(text, failed) {
    this.running.textContent = visible(text);
    this.running.classList.toggle("failed", failed);
  }

  // Until a run that was begun here ends.
  follow(redo) {
    const going = this.run.disabled;
    this.run.disabled = redo.under_way;
    if (redo.said) this.tell(redo.said, redo.failed);
    if (redo.under_way) setTimeout(() => this.told("edit/state").then((state) => this.follow(state.redo), (error) => this.lost(error)), LOOK_AGAIN_MS);
    else if (going) this.again();
  }

  lost(error) {
    this.run.disabled = false;
    this.tell(`The viewer does not answer: ${error.message}`, true);
  }

  // The page of a facade, into `fill`. Raises with the reason where there is none.
  async draw(block, id, fill) {
    this.wanted = id;
    const known = this.open.get(id);
    const page = known?.dirty() ? known : new Page(this, block, id);
    for (const [other, one] of this.open) if (!one.dirty()) this.open.delete(other);
    this.open.set(id, page);
    if (page !== known) await page.load();
    if (this.wanted !== id) return; // another was asked for meanwhile
    page.refreshed(block);
    fill(...page.parts);
    page.editor.draw();
  }

  // What is shown of `id` after another snapshot: its pictures, and its boxes where nothing is unsaved.
  async renew(block, id) {
    const page = this.open.get(id);
    if (!page) return;
    page.refreshed(block);
    if (!page.dirty()) await page.reload();
  }
}

class Page {
  constructor(correcting, block, id) {
    Object.assign(this, { correcting, block, id });
    this.facade = block.facades.find((facade) => facade.id === id);
    if (!this.facade) throw new Error(`There is no facade ${id} in this block.`);
  }

  async load() {
    const { stages } = await ask(`api/facade?id=${encodeURIComponent(this.id)}`);
    const under = UNDER.map((name) => stages.find(({ stage }) => stage === name)).filter(Boolean);
    if (!under.length) throw new Error(`Facade ${this.id} is not made yet: there is nothing to draw on.`);
    const stand = await this.correcting.told(`edit/facade?id=${encodeURIComponent(this.id)}`);
    const colours = Object.fromEntries(this.block.parse_colours.map(([colour, name]) => [name, colour]));
    this.editor = new Editor(stand, this.correcting.labels, colours, () => this.changed());
    this.parts = this.made(under, stand);
    this.stands(stand);
    this.changed();
  }

  dirty() {
    return this.editor !== undefined && (this.editor.dirty || this.differs().length > 0);
  }

  // The names of what is said otherwise than it stands, beside boxes.
  differs() {
    return Object.keys(this.stand.said).filter((name) => this.editor.said[name] !== this.stand.said[name]);
  }

  // What a field says; what stands where it is empty.
  read(name) {
    const field = this.fields[name];
    const said = field.type === "number" ? field.valueAsNumber : field.value.trim();
    return (field.type === "number" ? Number.isNaN(said) : said === "" && name !== "exemplar") ? this.stand.said[name] : said;
  }

  // What is known to be kept.
  stands(stand) {
    this.stand = stand;
    this.editor.stands(stand.said);
    for (const [name] of WORDS) {
      const { [name]: now } = stand.said;
      const { [name]: drawn } = this.correcting.words;
      const words = drawn.includes(now) ? drawn : [now, ...drawn];
      this.fields[name].replaceChildren(...words.map((word) => element("option", { value: word }, word || "not known")));
    }
    this.listed();
  }

  // Who corrected what.
  listed() {
    const { corrected } = this.stand;
    this.before.replaceChildren(...corrected.map((one) =>
      element("li", {}, `${one.what} of ${one.id}: ${one.who || "somebody"}, ${one.when.slice(0, 10)}${one.why ? `, “${one.why}”` : ""}`)));
    this.back.hidden = !corrected.length;
  }

  async reload() {
    const stand = await this.correcting.told(`edit/facade?id=${encodeURIComponent(this.id)}`);
    if (this.dirty()) return; // somebody drew meanwhile
    if (String(stand.size) !== String(this.stand.size)) { // the wall has another height now
      const [before] = this.parts;
      await this.load();
      before.replaceWith(...this.parts);
      this.refreshed(this.block);
      this.editor.draw();
      return;
    }
    this.editor.restart(stand);
    this.stands(stand);
    this.editor.lines = { rows: stand.rows, columns: stand.columns };
    this.editor.lattice();
    this.editor.select(null);
  }

  refreshed(block) {
    this.block = block;
    this.shown();
  }

  shown() {
    this.editor.image.setAttribute("href", picture(this.id, this.under.value, this.block.snapshot));
  }

  made(under, stand) {
    const button = (id, text, act, keys) => element("button", { type: "button", id, onclick: act, "aria-keyshortcuts": keys }, text);
    const choice = (id, options, act) => element("select", { id, onchange: act }, ...options.map(([value, text]) => element("option", { value }, text)));
    const labelled = (text, field) => element("span", { class: "field" }, element("label", { for: field.id }, text), field);
    const { editor } = this;
    this.label = choice("label", editor.labels.map((name) => [name, name]), () => editor.called(this.label.value));
    this.remove = button("delete", "Delete", () => editor.remove(), "Delete");
    this.undo = button("undo", "Undo", () => editor.undo(), "Control+Z");
    this.again = button("redo", "Redo", () => editor.redo(), "Control+Y");
    this.snap = element("input", { type: "checkbox", id: "snap", onchange: () => editor.snapping(this.snap.checked) });
    this.under = choice("under", under.map(({ stage, title }) => [stage, title]), () => this.shown());
    this.zoom = choice("zoom", [["1", "whole"], ["2", "2 times"], ["4", "4 times"]], () => (this.canvas.dataset.zoom = this.zoom.value));
    this.canvas = element("div", { class: "canvas", "data-zoom": "1" }, editor.svg);
    this.completions = new Completions(editor, (boxes) => this.correcting.told("edit/completions", { facade: this.id, ...boxes }));
    editor.svg.setAttribute("aria-label", `Elements of facade ${this.id}`);
    this.told = element("p", { role: "status", id: "box-said" });
    this.not = button("not-a-facade", "Not a facade", () => editor.say("facade", !editor.said.facade));
    const say = (name) => () => editor.say(name, this.read(name));
    const { exemplar } = stand.said;
    const names = stand.exemplars.includes(exemplar) || !exemplar ? stand.exemplars : [...stand.exemplars, exemplar];
    this.fields = {
      ...Object.fromEntries(NUMBERS.map(([name, id, , min, max, step]) => [name, element("input", { type: "number", id, min, max, step, oninput: say(name) })])),
      ...Object.fromEntries(WORDS.map(([name]) => [name, choice(name, [], say(name))])),
      ...Object.fromEntries(COLOURS.map(([name]) => [name, element("input", { type: "text", id: name, size: 9, maxlength: 40, placeholder: "#a0522d", oninput: say(name) })])),
      exemplar: choice("exemplar", [["", "as chosen by itself"], ...names.map((name) => [name, name])], say("exemplar")),
    };
    this.pickers = Object.fromEntries(COLOURS.map(([name, called]) =>
      [name, element("input", { type: "color", id: `pick_${name}`, "aria-label": `Choose the ${called}`, oninput: (event) => editor.say(name, event.target.value) })]));
    this.why = element("input", { type: "text", id: "why", maxlength: 500 });
    this.keep = button("save", "Save", () => this.save(), "Control+S");
    this.back = button("as-found", "Take back what was corrected", () => this.withdraw());
    this.result = element("p", { role: "status", id: "saved" });
    this.before = element("ul", {});
    const others = this.block.to_look_at.filter((id) => id !== this.id);
    const at = this.block.to_look_at.indexOf(this.id);
    const next = at < 0 ? others[0] : this.block.to_look_at[at + 1];
    const page = element("section", { class: "correcting", onkeydown: (event) => this.key(event) },
      element("h2", {}, `Correct facade ${this.id}`),
      element("p", { class: "ways" }, element("a", { href: facadeAddress(this.id) }, "Its stages"), element("a", { href: blockPage("review") }, "All to look at"),
        next ? element("a", { href: editAddress(next) }, "Next to look at") : null, element("span", {}, `${this.facade.street}; ${said(this.facade.quality)}`)),
      element("div", { class: "controls" }, labelled("Label", this.label), button("add", "Add a box", () => { editor.add(); editor.svg.focus(); }), this.remove,
        this.undo, this.again, element("span", { class: "field" }, this.snap, element("label", { for: "snap" }, "Snap to lattice")),
        labelled("On", this.under), labelled("Size", this.zoom)),
      this.canvas, legend(editor.labels.map((label) => [editor.colour(label), label])), this.told, this.completions.part,
      element("p", { id: "keys", class: "keys" }, "In the picture: drag a box, its handles or a new one. Keys: A adds, N and P choose, arrows move, Shift and arrows stretch, 1 to ",
        `${editor.labels.length} label, Delete, S snaps, Ctrl Z and Ctrl Y, Ctrl S saves. “hide” is what a picture shows that is not of the facade, “keep” what is of it although it looks like something in front. `,
        `What is saved is kept in ${this.correcting.kept}; pictures change at “Run now” only.`),
      element("fieldset", { class: "controls" }, element("legend", {}, `Building ${stand.building}`),
        ...NUMBERS.map(([name, , called]) => labelled(called, this.fields[name])), ...WORDS.map(([name, called]) => labelled(called, this.fields[name])),
        ...COLOURS.map(([name, called]) => element("span", { class: "field" }, labelled(called, this.fields[name]), this.pickers[name])),
        labelled("its exemplar", this.fields.exemplar)),
      element("div", { class: "controls" }, this.not, labelled("Why", this.why), this.keep, this.back),
      this.result, this.before);
    return [page];
  }

  key(event) {
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    const typing = event.target.matches("input[type=text], input[type=number]");
    const act = { s: () => this.save(), z: !typing && (() => (event.shiftKey ? this.editor.redo() : this.editor.undo())), y: !typing && (() => this.editor.redo()) }[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act();
  }

  changed() {
    const { editor } = this;
    const { box } = editor;
    this.label.value = editor.label;
    this.snap.checked = editor.snap;
    this.remove.disabled = !box;
    this.undo.disabled = !editor.steps.past.length;
    this.again.disabled = !editor.steps.future.length;
    this.not.setAttribute("aria-pressed", String(!editor.said.facade));
    this.showFields();
    this.keep.disabled = !this.dirty();
    this.completions.changed();
    const metres = (texels) => (texels / editor.metre).toFixed(2);
    const count = editor.boxes.length;
    this.told.textContent = box
      ? `${box.label}, box ${editor.selected + 1} of ${count}: ${metres(box.x1 - box.x0)} m wide, ${metres(box.y1 - box.y0)} m high, ${metres(box.x0)} m from the left, ${metres(editor.size[1] - box.y1)} m over the ground`
      : `${count} boxes; none is chosen`;
  }

  // Fields as they are said, but for one that is being written.
  showFields() {
    const { said } = this.editor;
    const model = this.stand.said.height === null;
    for (const [name, field] of Object.entries(this.fields)) {
      if (this.read(name) !== said[name] || document.activeElement !== field) field.value = said[name] ?? "";
      field.disabled = model && ["height", "roof_shape", "roof_height"].includes(name);
    }
    this.fields.roof_height.disabled ||= ["", "flat"].includes(said.roof_shape);
    for (const [name, picker] of Object.entries(this.pickers)) if (/^#[0-9a-f]{6}$/i.test(said[name])) picker.value = said[name];
  }

  async save() {
    if (!this.dirty()) return;
    const corrections = [];
    const { editor, stand } = this;
    const { boxes, said } = editor;
    if (editor.dirty) corrections.push({ facade_id: this.id, ...editor.shares() });
    const { facade, ...building } = Object.fromEntries(this.differs().map((name) => [name, said[name]]));
    if (facade !== undefined) corrections.push({ facade_id: this.id, facade: facade ? null : false });
    if ("exemplar" in building) building.exemplar ||= null;
    if (building.roof_shape === "flat") delete building.roof_height;
    if (Object.keys(building).length) corrections.push({ building_id: stand.building, ...building });
    if (await this.send(corrections)) editor.saved = boxes;
    this.changed();
  }

  async withdraw() {
    const corrections = this.stand.corrected.map(({ id, what }) => ({ [id === this.id ? "facade_id" : "building_id"]: id, [what]: null }));
    if (await this.send(corrections)) this.editor.restart(this.stand);
    this.editor.select(null);
  }

  // Whether corrections are kept now; says so, or why they are not.
  async send(corrections) {
    const say = (text, failed) => {
      this.result.textContent = visible(text);
      this.result.classList.toggle("failed", failed);
    };
    try {
      const done = await this.correcting.told("edit/corrections", { corrections, why: this.why.value, facade: this.id, stood: this.stand.corrected });
      this.stands(await this.correcting.told(`edit/facade?id=${encodeURIComponent(this.id)}`));
      say([done.said, ...done.notes].join("; "), false);
      return true;
    } catch (error) {
      say(error.message, true);
      const { corrected } = await this.correcting.told(`edit/facade?id=${encodeURIComponent(this.id)}`).catch(() => this.stand);
      this.stand = { ...this.stand, corrected };
      this.listed();
      return false;
    }
  }
}
