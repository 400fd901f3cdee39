// What the pages are made of: elements, texts out of data, what the server says.

const SVG = "http://www.w3.org/2000/svg";

export function element(name, attributes = {}, ...children) {
  const made = ["svg", "g", "path", "line", "circle", "rect", "image", "title", "text", "polygon"].includes(name)
    ? document.createElementNS(SVG, name)
    : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(key, value === true ? "" : /^(alt|title|aria-.*)$/.test(key) ? visible(String(value)) : value);
  }
  made.append(...children.filter((child) => child !== null).map((child) => (typeof child === "string" ? visible(child) : child)));
  return made;
}

// Text out of data with what turns the reading direction, ends lines or is not seen written out, as catalogs/visible.py does.
export function visible(text) {
  return text.replace(/(?![\u200c\u200d])[\p{Cc}\p{Cf}\p{Cs}\p{Zl}\p{Zp}]/gu, (character) => {
    const code = character.codePointAt(0).toString(16);
    return code.length <= 2 ? `\\x${code.padStart(2, "0")}` : code.length <= 4 ? `\\u${code.padStart(4, "0")}` : `\\U${code.padStart(8, "0")}`;
  });
}

// The block that pages show: where the server answers for it, and how addresses of its pages begin. One run is block 0 alone.
const open = { number: 0, base: "", prefix: "" };

export function openBlock(number, single) {
  Object.assign(open, { number, base: blockBase(number, single), prefix: single ? "" : `block/${number}/` });
}

export const blockBase = (number, single) => (single ? "" : `blocks/${number}/`);
export const openBase = () => open.base;
export const openNumber = () => open.number;
export const blockPage = (page) => `#/${open.prefix}${page}`;

// A page without a server reads each answer from a file, named by a digest (FNV-1a) of each value asked for: flows/viewer/static_page.py writes them.
export const isStatic = document.querySelector("meta[name=static]") !== null;
const digest = (text) => new TextEncoder().encode(text).reduce((hash, byte) => BigInt.asUintN(64, (hash ^ BigInt(byte)) * 0x100000001b3n), 0xcbf29ce484222325n).toString(16);
function filed(path, ending) {
  if (!isStatic) return path;
  const [name, query] = path.split("?");
  const values = [...new URLSearchParams(query)].filter(([key]) => key !== "of" && key !== "height").map(([, value]) => digest(value));
  return [name, ...values].join("/") + ending;
}

// What the server says: of the open block, or of the city where `base` is empty.
export async function ask(path, base = open.base) {
  const answer = await fetch(base + filed(path, ".json"));
  const said = await answer.json();
  if (!answer.ok) throw new Error(said.reason || answer.statusText);
  return said;
}

export const picture = (facade, stage, snapshot, height = null, base = open.base) =>
  base + filed(`picture/facade?id=${encodeURIComponent(facade)}&stage=${encodeURIComponent(stage)}&of=${snapshot}${height ? `&height=${height}` : ""}`, ".webp");
export const pictureBefore = (facade, snapshot) => open.base + filed(`picture/before?id=${encodeURIComponent(facade)}&of=${snapshot}`, ".webp");
export const facadeAddress = (id) => blockPage(`facade/${encodeURIComponent(id)}`);

export function legend(entries) {
  const swatch = (colour) => element("svg", { viewBox: "0 0 12 8", "aria-hidden": "true" }, element("rect", { width: 12, height: 8, fill: colour }));
  return element("div", { class: "legend" }, ...entries.map(([colour, text]) => element("span", {}, swatch(colour), text)));
}
