// The map of blocks, drawn by MapLibre GL: their outlines by state and, where they are large enough, buildings, streets and facades.
// Metres from the map's origin, x east and y north, lie on the plane where equator and first meridian cross: no server is asked for anything.

import { Map as Engine, NavigationControl, ScaleControl, setWorkerUrl } from "./vendor/maplibre-gl.js";
import { STATES } from "./city.js";
import { element, visible } from "./elements.js";
import { boxOf, distance, unite } from "./geometry.js";

setWorkerUrl(new URL("vendor/maplibre-gl-worker.js", import.meta.url).href);

// A block that is this large shows its facades, pixels; and so many blocks at a time.
const DETAIL_PX = 90;
const MOST_DETAILED = 16;
// How far from a facade a click still chooses it, pixels.
const REACH_PX = 12;
const STREET_M = 7;
const BUILDING_M = 9; // assumed height where no facade states one
const WALL_M = 0.4; // thickness of a facade in the tilted map
const DEGREE_M = (6378137 * Math.PI) / 180;
const pxPerMetre = (zoom) => (512 * 2 ** zoom) / (360 * DEGREE_M);

const lngLat = (point) => point.map((value) => value / DEGREE_M);
const ring = (points) => [...points, points[0]].map(lngLat);
const feature = (type, coordinates, properties) => ({ type: "Feature", geometry: { type, coordinates }, properties: { ...properties, name: visible(properties.name || "") } });
const collection = (features) => ({ type: "FeatureCollection", features });
const SOURCES = ["blocks", "buildings", "streets", "facades", "walls", "marks"];
const is = (name) => ["==", ["get", "kind"], name];
const byZoom = (metres) => ["interpolate", ["exponential", 2], ["zoom"], 8, metres * pxPerMetre(8), 22, metres * pxPerMetre(22)];
const facadeColour = ["case", ["boolean", ["feature-state", "hover"], false], "#e08a00", ["get", "colour"]];
const NAME = { layout: { "text-field": ["get", "name"], "text-font": ["sans-serif"], "text-size": 12 }, paint: { "text-color": "#1d2329", "text-halo-color": "#fff", "text-halo-width": 1.5 } };
const layer = (id, type, source, paint, more = {}) => ({ id, type, source, paint, ...more });
const LAYERS = [
  layer("background", "background", undefined, { "background-color": "#f4f2ee" }),
  layer("blocks", "fill", "blocks", { "fill-color": ["get", "colour"], "fill-opacity": ["case", ["get", "detailed"], 0.04, 0.28] }),
  layer("block-lines", "line", "blocks", { "line-color": ["get", "colour"], "line-width": 1.5, "line-opacity": ["case", ["get", "detailed"], 0.4, 1] }),
  layer("buildings", "fill", "buildings", { "fill-color": ["case", ["get", "own"], "#dcd6cc", "#eae7e1"], "fill-outline-color": "#b9b1a4" }),
  layer("streets", "line", "streets", { "line-color": "#fff", "line-width": byZoom(STREET_M) }, { layout: { "line-cap": "round", "line-join": "round" } }),
  layer("facades", "line", "facades", { "line-color": facadeColour, "line-opacity": ["get", "opacity"], "line-width": ["interpolate", ["linear"], ["zoom"], 14, 1.6, 20, 7] }),
  layer("solids", "fill-extrusion", "buildings", { "fill-extrusion-color": "#dcd6cc", "fill-extrusion-height": ["get", "height"] }),
  layer("walls", "fill-extrusion", "walls", { "fill-extrusion-color": facadeColour, "fill-extrusion-height": ["get", "height"] }),
  layer("areas", "fill", "marks", { "fill-color": "#ffb000", "fill-opacity": 0.2 }, { filter: is("area") }),
  layer("marks", "line", "marks", { "line-color": "#ffb000", "line-width": ["case", is("area"), 4, 9], "line-opacity": 0.75 }, { filter: ["any", is("area"), is("mark")], layout: { "line-cap": "round" } }),
  layer("looks", "line", "marks", { "line-color": "#d1320f", "line-width": 2 }, { filter: is("looks") }),
  layer("here", "circle", "marks", { "circle-radius": 6, "circle-color": "#d1320f", "circle-stroke-color": "#fff", "circle-stroke-width": 2 }, { filter: is("here") }),
  layer("signs", "circle", "marks", { "circle-radius": 11, "circle-color": "#fff", "circle-stroke-color": "#566069", "circle-stroke-width": 1 }, { filter: is("sign") }),
  layer("sign-names", "symbol", "marks", {}, { filter: is("sign"), layout: { ...NAME.layout, "text-size": 15, "text-allow-overlap": true } }),
  layer("street-names", "symbol", "streets", NAME.paint, { layout: { ...NAME.layout, "symbol-placement": "line", "symbol-spacing": 320 } }),
  layer("block-names", "symbol", "blocks", NAME.paint, { layout: { ...NAME.layout, "text-max-width": 8 }, filter: ["!", ["get", "detailed"]] }),
];
const RAISED = ["solids", "walls"]; // in the tilted map alone

export class BlockMap {
  // label: what the map shows, for those who do not see it; choose: called with (block, facade id); view: called when another
  // part is shown, with the numbers of the blocks whose facades it needs; colour, strong, sign: of a facade.
  constructor({ label, choose, view = () => {}, colour, strong = () => true, sign = () => null }) {
    Object.assign(this, { choose, view, colour, strong, sign, shapes: new Map(), details: new Map(), marked: [], here: null, whole: null, touched: false });
    this.element = Object.assign(element("div", { class: "map" }), { map: this });
    const style = { version: 8, light: { intensity: 0.25 }, sources: Object.fromEntries(SOURCES.map((name) => [name, { type: "geojson", data: collection([]), generateId: true, maxzoom: 20 }])), layers: LAYERS };
    try {
      this.engine = new Engine({ container: this.element, style, attributionControl: false, locale: { "Map.Title": label }, maxPitch: 75, renderWorldCopies: false, fadeDuration: 0 });
    } catch (cause) {
      throw new Error("this browser has no WebGL 2, which the map needs; the other pages work without", { cause });
    }
    const all = element("button", { type: "button", "aria-label": "Show all", title: "Show all", onclick: () => this.goTo(this.whole) }, "\u2922");
    this.engine.addControl(new NavigationControl({ visualizePitch: true }), "top-right");
    this.engine.addControl({ onAdd: () => element("div", { class: "maplibregl-ctrl maplibregl-ctrl-group" }, all), onRemove: () => all.parentElement.remove() }, "top-right");
    this.engine.addControl(new ScaleControl({ maxWidth: 130 }), "bottom-left");
    this.element.addEventListener("keydown", (event) => event.key === "0" && this.goTo(this.whole));
    this.engine.on("style.load", () => { this.raise(); this.renew(); });
    this.engine.on("movestart", ({ originalEvent }) => { this.touched ||= Boolean(originalEvent); });
    this.engine.on("pitch", () => this.raise());
    this.engine.on("moveend", () => this.settle());
    this.engine.on("resize", () => this.touched || this.fit(this.fitted || this.whole));
    this.engine.on("click", (event) => this.clicked(event));
    this.engine.on("mousemove", (event) => this.hover(this.facadeAt(event.point)));
  }

  // Blocks: [{number, outline [[x, y]], state, name}]; those that are gone are taken away.
  setBlocks(blocks) {
    this.shapes = new Map(blocks.filter(({ outline }) => outline.length).map((block) => [block.number, { ...block, box: boxOf(block.outline) }]));
    for (const number of this.details.keys()) if (!this.shapes.has(number)) this.details.delete(number);
    if (this.shapes.size) this.extend(unite([...this.shapes.values()].map(({ box }) => box)));
    this.settle();
  }

  // The map of a block, [dx, dy] metres from the map's origin.
  setDetail(number, block, offset) {
    this.details.set(number, { block, offset });
    if (!this.shapes.size) this.extend(unite([...this.details.values()].map(({ block: { size: [width, height] }, offset: [dx, dy] }) => [dx, dy, dx + width, dy + height])));
    this.settle();
  }

  // Box of all that there is; it is shown until somebody pans or zooms.
  extend(box) {
    this.whole = box;
    if (!this.touched) this.fit(box);
  }

  fit(box) {
    if (!box) return;
    this.fitted = box;
    this.engine.fitBounds([lngLat(box.slice(0, 2)), lngLat(box.slice(2))], { padding: 30, maxZoom: 20, animate: false });
  }

  // Show a box because somebody asked for it.
  goTo(box) {
    this.touched = true;
    this.fit(box);
  }

  // What is shown: [x0, y0, x1, y1].
  box() {
    return this.engine.getBounds().toArray().flat().map((value) => DEGREE_M * value);
  }

  middle() {
    return this.engine.getCenter().toArray().map((value) => DEGREE_M * value);
  }

  // Marks: [{points: [[x, y]], closed}], in place of those before; `here` with `heading` in degrees, of somebody who stood there.
  mark(marks, here = null) {
    Object.assign(this, { marked: marks, here });
    this.renew();
  }

  // Numbers of the blocks that are shown with their facades, those in the middle first.
  wanted() {
    const [x0, y0, x1, y1] = this.box();
    const [x, y] = this.middle();
    const scale = pxPerMetre(this.engine.getZoom());
    const shown = [...this.shapes.values()].filter(({ box }) => box[2] > x0 && box[0] < x1 && box[3] > y0 && box[1] < y1);
    const large = shown.filter(({ box }) => this.shapes.size === 1 || scale * Math.max(box[2] - box[0], box[3] - box[1]) >= DETAIL_PX);
    const far = ({ box }) => Math.hypot((box[0] + box[2]) / 2 - x, (box[1] + box[3]) / 2 - y);
    return large.sort((a, b) => far(a) - far(b)).slice(0, MOST_DETAILED).map(({ number }) => number);
  }

  // What depends on the part that is shown.
  settle() {
    const wanted = this.shapes.size ? this.wanted() : [...this.details.keys()];
    for (const number of this.details.keys()) if (!wanted.includes(number)) this.details.delete(number);
    this.renew();
    this.view(wanted);
  }

  // Give the engine what is drawn, once for all that changes together.
  renew() {
    if (this.renewing || !this.engine.getSource("blocks")) return;
    this.renewing = true;
    queueMicrotask(() => {
      this.renewing = false;
      for (const [name, features] of Object.entries(this.drawn())) this.engine.getSource(name)?.setData(collection(features));
    });
  }

  drawn() {
    const drawn = Object.fromEntries(SOURCES.map((name) => [name, []]));
    for (const { number, outline, state, name } of this.shapes.values()) drawn.blocks.push(feature("Polygon", [ring(outline)], { number, state, name, colour: STATES[state][0], detailed: this.details.has(number) }));
    for (const [number, { block, offset }] of this.details) {
      const placed = (points) => points.map(([x, y]) => [x + offset[0], y + offset[1]]);
      const heights = new Map();
      block.facades.forEach((facade, index) => {
        const [[x1, y1], [x2, y2]] = placed(facade.line);
        const shown = { number, index, id: facade.id, name: `${facade.id}: ${facade.street}, ${facade.status}`, colour: this.colour(facade), opacity: this.strong(index, number) ? 1 : 0.25, height: facade.height_m || BUILDING_M };
        heights.set(facade.building, Math.max(heights.get(facade.building) || 0, shown.height));
        const [east, north] = [Math.sin, Math.cos].map((of) => WALL_M * of((facade.azimuth_deg * Math.PI) / 180));
        drawn.facades.push(feature("LineString", [[x1, y1], [x2, y2]].map(lngLat), shown));
        drawn.walls.push(feature("Polygon", [ring([[x1, y1], [x2, y2], [x2 + east, y2 + north], [x1 + east, y1 + north]])], shown));
        const sign = this.sign(facade);
        if (sign) drawn.marks.push(feature("Point", lngLat([(x1 + x2) / 2, (y1 + y2) / 2]), { kind: "sign", name: sign }));
      });
      for (const { id, own, rings } of [...block.buildings].sort((a, b) => a.own - b.own)) drawn.buildings.push(feature("Polygon", rings.map((points) => ring(placed(points))), { id, own, height: heights.get(id) || BUILDING_M }));
      for (const { name, line } of block.streets) drawn.streets.push(feature("LineString", placed(line).map(lngLat), { name }));
    }
    for (const { points, closed } of this.marked) drawn.marks.push(closed ? feature("Polygon", [ring(points)], { kind: "area" }) : feature("LineString", points.map(lngLat), { kind: "mark" }));
    if (this.here) {
      const { at: [x, y], heading } = this.here;
      const [east, north] = [Math.sin, Math.cos].map((of) => 12 * of(((heading || 0) * Math.PI) / 180));
      if (heading !== null) drawn.marks.push(feature("LineString", [[x, y], [x + east, y + north]].map(lngLat), { kind: "looks" }));
      drawn.marks.push(feature("Point", lngLat([x, y]), { kind: "here" }));
    }
    return drawn;
  }

  // Buildings and facades stand up once the map is tilted.
  raise() {
    const tilted = this.engine.getPitch() > 1;
    for (const name of RAISED) this.engine.setLayoutProperty(name, "visibility", tilted ? "visible" : "none");
  }

  // The facade of the map at a place of the picture, the nearest of those around.
  facadeAt({ x, y }) {
    if (!this.engine.getLayer("walls")) return null;
    const [wall] = this.engine.queryRenderedFeatures([x, y], { layers: ["walls"] });
    if (wall) return wall;
    const at = this.engine.unproject([x, y]).toArray();
    const away = ({ geometry }) => distance(at, geometry.coordinates);
    const around = this.engine.queryRenderedFeatures([[x - REACH_PX, y - REACH_PX], [x + REACH_PX, y + REACH_PX]], { layers: ["facades"] });
    return around.filter(({ geometry }) => geometry.type === "LineString").sort((a, b) => away(a) - away(b))[0] || null;
  }

  hover(found) {
    if (this.hovered?.id === found?.id) return;
    for (const [one, hover] of [[this.hovered, false], [found, true]]) {
      if (one) for (const source of ["facades", "walls"]) this.engine.setFeatureState({ source, id: one.id }, { hover });
    }
    this.hovered = found;
    Object.assign(this.engine.getCanvas(), { title: found?.properties.name || "" }).style.cursor = found ? "pointer" : "";
  }

  // A click chooses a facade, or goes to a block.
  clicked({ point }) {
    const facade = this.facadeAt(point);
    if (facade) {
      this.choose(facade.properties.number, facade.properties.id);
      return;
    }
    const [block] = this.engine.queryRenderedFeatures(point, { layers: ["blocks"] });
    if (block && !block.properties.detailed) this.goTo(this.shapes.get(block.properties.number).box);
  }
}

let small = null; // the map of one block that pages share: each needs a context of the graphics card

// A small map of one block and nothing else: `within` are corners [low, high] of the part that is shown first.
export function smallMap(block, { colour, strong = () => true, here = null, heading = null, within = null, called = () => null, choose, label }) {
  if (small?.block !== block) {
    small?.engine.remove();
    small = Object.assign(new BlockMap({ label, choose: (_, id) => small.chosen(id), colour }), { block });
  }
  Object.assign(small, { colour, strong, sign: called, chosen: choose, touched: false });
  small.fitted = within?.flat() || null;
  small.engine.getCanvas().setAttribute("aria-label", label);
  small.mark([], here && { at: here, heading });
  small.setDetail(0, block, [0, 0]);
  if (within) small.fit(small.fitted);
  return small.element;
}
