// Values of facades in words, and their colours: classes with round limits. The block's map has the columns with labels and units.

import { legend } from "./elements.js";

const UNITS = { metres: "m", seconds: "s", degrees: "°", bytes: "bytes" };
// From low to high, readable with any colour vision.
const SCALE = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#d8c31a"];
const GROUPS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#5b3a8c", "#a03030"];
export const STATUS = { done: "#1c7a43", failed: "#b3261e", stale: "#a9600a", waiting: "#8b949c" };
const UNKNOWN = "#b9bfc4";
// What a facade's texture rests on, from best to least known.
const EVIDENCE = { pictured: "#1f6fb2", completed: "#58b7c8", "in a style": "#e0a030", assumed: "#a39b90" };
const PICTURED = 0.5; // share of texels from pictures
const FIXED = { status: STATUS, evidence: EVIDENCE };
const EVIDENCE_COLUMN = { name: "evidence", label: "Evidence", type: "string", unit: "", words: {}, common: true,
  meaning: "pictured (pictures show half of it or more), completed (they show less), in a style (an exemplar's), assumed (a back that nobody sees)" };

export const evidenceColour = ({ evidence }) => EVIDENCE[evidence] || UNKNOWN;
export const byEvidence = ({ evidence }) => [...Object.keys(EVIDENCE), undefined].indexOf(evidence); // the best known first
export const evidenceLegend = () => legend(Object.entries(EVIDENCE).map(([text, colour]) => [colour, text]));

// A block's map with the column `evidence`.
export function withEvidence(block) {
  for (const facade of block.facades) {
    if (facade.status === "done") facade.evidence = facade.photo >= PICTURED ? "pictured" : facade.photo > 0 ? "completed" : facade.role === "back" ? "assumed" : "in a style";
  }
  return { ...block, columns: [EVIDENCE_COLUMN, ...block.columns] };
}

// What the words of `quality` mean, and what mends it.
const suggested = ({ floors, levels, height_m }) =>
  floors && levels && floors !== levels ? ` Floors seen: ${floors}, which suggest a height of ${short((floors * height_m) / levels)} m.` : "";
export const REMEDIES = {
  "height-assumed": (facade) => `The map states no height for this building; ${said(facade.height_m, "metres")} is assumed.${suggested(facade)} Add it to the map, or correct it with view --edit.`,
  "floors-differ": (facade) => `Floors expected from its height or stated by the map: ${facade.levels}.${suggested(facade)} Correct the height of its building, or the boxes of its windows.`,
  "foreign-parts": () => "Its texture shows people, cars, trees, sky or a neighbour. Hide them with view --edit, or add a photo without them.",
  "garbled-inpainting": () => "A large part is hidden in its pictures, and what was inpainted hardly looks like a facade. Add a photo that shows it.",
  "no-windows": () => "No window was found. If it has some, draw them with view --edit, or mark it as no facade.",
  "implausible-layout": () => "Few real facades have windows and doors arranged like this. Choose another exemplar with view --edit, or add a photo.",
  "doubtful-cut": () => "Its outline in the photo is doubtful. Compare it with the rectified picture; take a photo that shows the whole wall.",
  "rejected-picture": ({ reason }) => `A picture of it was rejected${reason ? `: ${reason}` : "."} Correct that picture or its place, or remove it.`,
};

export const columnLabel = (name, columns) => columns.find((column) => column.name === name)?.label || "";

// Columns by which facades may be coloured: [those that are common, the others].
export const choices = (columns) => [true, false].map((common) => columns.filter((column) => Boolean(column.common) === common));

// A value in words, with its unit.
export function said(value, unit = "", words = {}) {
  if (value === undefined || value === null) return "–";
  if (words[value]) return words[value];
  if (unit === "0 to 1" && typeof value === "number") return `${short(100 * value)}\u00a0%`;
  const text = typeof value === "number" ? short(value) : String(value);
  return unit ? `${text}${unit === "degrees" ? "" : "\u00a0"}${UNITS[unit] || unit}` : text;
}

const short = (value) => (Number.isInteger(value) ? String(value) : Math.abs(value) >= 100 ? value.toFixed(0) : String(Number(value.toPrecision(3))));

// Limits of at most `most` classes from low to high: multiples of 1, 2 or 5 times a power of ten.
export function classLimits(low, high, whole, most = SCALE.length) {
  if (!(high > low)) return [low];
  for (let power = Math.floor(Math.log10((high - low) / most)); ; power++) {
    for (const digit of [1, 2, 5]) {
      const step = digit * 10 ** power;
      if (whole && step < 1) continue;
      const first = Math.floor(low / step + 1e-9);
      const count = Math.floor(high / step + 1e-9) - first + (whole || high / step - Math.floor(high / step) > 1e-9 ? 1 : 0);
      if (count <= most) return Array.from({ length: Math.max(count, 1) }, (_, i) => Number(((first + i) * step).toPrecision(12)));
    }
  }
}

// How a column colours facades: {of(facade) -> colour, legend: [[colour, text]]}.
export function colouring(name, facades, columns) {
  if (FIXED[name]) {
    const there = new Set(facades.map((facade) => facade[name]));
    return { of: (facade) => FIXED[name][facade[name]] || UNKNOWN, legend: Object.entries(FIXED[name]).filter(([text]) => there.has(text)).map(([text, colour]) => [colour, text]) };
  }
  const column = columns.find((one) => one.name === name) || { type: "string", unit: "", words: {} };
  const values = facades.map((facade) => facade[name]).filter((value) => value !== undefined);
  const unknown = values.length < facades.length ? [[UNKNOWN, "unknown"]] : [];
  if (values.length && values.every((value) => typeof value === "number") && !Object.keys(column.words).length) {
    const whole = column.type.startsWith("int");
    const share = column.unit === "0 to 1" ? 100 : 1;
    const [low, high] = values.reduce(([least, most], value) => [Math.min(least, value), Math.max(most, value)], [Infinity, -Infinity]);
    const limits = classLimits(share * low, share * high, whole);
    const colours = limits.map((_, i) => SCALE[limits.length > 1 ? Math.round((i * (SCALE.length - 1)) / (limits.length - 1)) : 2]);
    const number = (value) => Math.max(0, limits.findLastIndex((limit) => share * value >= limit - 1e-9));
    const unit = share === 100 ? " %" : column.unit ? ` ${UNITS[column.unit] || column.unit}` : "";
    const step = limits.length > 1 ? limits[1] - limits[0] : 0;
    const text = (from) => (!step ? `${short(from)}${unit}` : whole ? `${from}${step > 1 ? ` to ${from + step - 1}` : ""}${unit}` : `${short(from)} to ${short(from + step)}${unit}`);
    return { of: (facade) => (facade[name] === undefined ? UNKNOWN : colours[number(facade[name])]), legend: [...limits.map((limit, i) => [colours[i], text(limit)]), ...unknown] };
  }
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) || 0) + 1);
  const common = [...counts.entries()].sort((a, b) => b[1] - a[1]).slice(0, GROUPS.length).map(([value]) => value);
  const others = counts.size > common.length ? [[UNKNOWN, unknown.length ? "other or unknown" : "other"]] : unknown;
  return {
    of: (facade) => (common.includes(facade[name]) ? GROUPS[common.indexOf(facade[name])] : UNKNOWN),
    legend: [...common.map((value, i) => [GROUPS[i], said(value, "", column.words)]), ...others],
  };
}
