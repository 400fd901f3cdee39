// Bundle the viewer's libraries into the folder that is named, with the licences of all that is in them: `make engines`.

import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const [folder] = process.argv.slice(2);
const library = (name) => `node_modules/maplibre-gl/dist/${name}`;
const { metafile } = await build({
  entryPoints: { three: "three.js", "maplibre-gl": library("maplibre-gl.mjs"), "maplibre-gl-worker": library("maplibre-gl-worker.mjs"), "maplibre-gl-style": library("maplibre-gl.css") },
  outdir: folder, bundle: true, minify: true, format: "esm", legalComments: "none", metafile: true, loader: { ".svg": "dataurl" },
});

const manifest = (name) => JSON.parse(readFileSync(`node_modules/${name}/package.json`, "utf8"));
const packages = new Set(Object.keys(metafile.inputs).map((path) => path.match(/node_modules\/((?:@[^/]+\/)?[^/]+)/)?.[1]).filter(Boolean));
for (const name of Object.keys(manifest("maplibre-gl").dependencies)) packages.add(name); // its files are bundles already
const licences = [...packages].sort().map((name) => {
  const { version, license } = manifest(name);
  const file = readdirSync(`node_modules/${name}`).find((one) => /^licen[cs]e/i.test(one));
  return `${name} ${version}, ${license}\n\n${file ? readFileSync(`node_modules/${name}/${file}`, "utf8").trim() : "No text is shipped with the package."}\n`;
});
writeFileSync(`${folder}/LICENCES.txt`, licences.join(`\n${"-".repeat(80)}\n\n`));
const sums = readdirSync(folder).filter((name) => name !== "SHA256SUMS").sort();
writeFileSync(`${folder}/SHA256SUMS`, sums.map((name) => `${createHash("sha256").update(readFileSync(`${folder}/${name}`)).digest("hex")}  ${name}\n`).join(""));
