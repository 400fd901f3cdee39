// The blocks of a city as the server lists them, and the maps of those that are looked at. One run is a city of one block.

import { withEvidence } from "./columns.js";
import { ask, blockBase } from "./elements.js";

// Maps of blocks that are kept.
const KEPT = 24;
// Requests for maps at a time.
const AT_ONCE = 2;
// A running block's map is asked for again after this time.
const RUNNING_MS = 8000;

export const STATES = {
  done: ["#1c7a43", "done"], running: ["#0b5fa5", "running"], failed: ["#b3261e", "failed"], stale: ["#a9600a", "out of date"], waiting: ["#8b949c", "waiting"],
};

export class City {
  constructor() {
    this.said = null; // what /api/city said last
    this.maps = new Map(); // number -> {key, at, block, promise}; the one that was used last at the end
    this.asked = 0;
    this.waiting = [];
  }

  get single() {
    return this.said.single;
  }

  get blocks() {
    return this.said.blocks;
  }

  block(number) {
    return this.blocks.find((one) => one.number === number);
  }

  // How a block is called: by its streets, with a number where several are on the same.
  called(number) {
    const block = this.block(number);
    if (!block) return `block ${number}`;
    if (!block.title) return block.name;
    const same = this.blocks.filter(({ title }) => title === block.title);
    return same.length > 1 ? `${block.title} (${same.indexOf(block) + 1} of ${same.length})` : block.title;
  }

  // Whether the list of blocks has changed.
  async refresh() {
    const before = JSON.stringify(this.said);
    this.said = await ask("api/city", "");
    return JSON.stringify(this.said) !== before;
  }

  find(text) {
    return ask(`api/find?text=${encodeURIComponent(text)}`, "");
  }

  // What a block's map is of: its newest snapshot, of one run also an unpublished one; of a running one, of now.
  key({ state, published, newest }) {
    return state === "running" ? `running ${Math.floor(Date.now() / RUNNING_MS)}` : `${state} ${newest || published}`;
  }

  // The map of a block that is here already, maybe of before; else null.
  here(number) {
    return this.maps.get(number)?.block || null;
  }

  stale(number) {
    const found = this.maps.get(number);
    return !found || found.key !== this.key(this.block(number));
  }

  // A block's map is not the newest.
  forget(number) {
    this.maps.delete(number);
  }

  // The newest map of a block.
  async load(number) {
    const row = this.block(number);
    const key = this.key(row);
    const known = this.maps.get(number);
    this.maps.delete(number);
    const entry = known?.key === key ? known : { key, block: known?.block, promise: this.fetch(number, row) };
    this.maps.set(number, entry);
    while (this.maps.size > KEPT) this.maps.delete(this.maps.keys().next().value);
    try {
      entry.block = await entry.promise;
    } catch (error) {
      if (this.maps.get(number) === entry && !entry.block) this.maps.delete(number);
      throw error;
    }
    return entry.block;
  }

  async fetch(number, { published, newest, state }) {
    if (this.asked >= AT_ONCE) await new Promise((go) => this.waiting.push(go));
    this.asked += 1;
    try {
      const shown = newest || published;
      const of = shown && state !== "running" ? `?of=${shown}` : "";
      return withEvidence(await ask(`api/block${of}`, blockBase(number, this.single)));
    } finally {
      this.asked -= 1;
      this.waiting.shift()?.();
    }
  }
}
