"""Solids of CityJSON exports by an independent validator: of a run, and of a model as it was given and as it is exported."""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

DELFSHAVEN = "city/delfshaven/3-20-DELFSHAVEN.city.json"


def main() -> None:
    """Export a run as cityjson and lod3, and Delfshaven's model from its geometry alone; prints what is in each file, and how
    much of it val3dity finds valid, as one JSON object."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("out", type=Path, nargs="?", help="the folder of a run; none: Delfshaven only")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="the data folder")
    parser.add_argument("--val3dity", type=Path, default=Path("../shared/tools/val3dity/run"), help="the validator")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for style in ("cityjson", "lod3") if options.out else ():
            start = time.perf_counter()
            path = _exported(options.out, style, Path(folder) / style)
            seconds = time.perf_counter() - start
            rows.append(row(f"{options.out.name} as {style}", path, options.val3dity, seconds))
        given = options.data / DELFSHAVEN
        if given.is_file():
            rows.append(row("Delfshaven as given", given, options.val3dity))
            start = time.perf_counter()
            path = of_model(given, Path(folder))
            rows.append(row("Delfshaven as cityjson", path, options.val3dity, time.perf_counter() - start))
    print(json.dumps({"benchmark": "solid", "files": rows}, indent=1))


def _exported(out: Path, style: str, to: Path) -> Path:
    from tasks.export.formats import export_run

    return Path(str(export_run(out, style, to).files[0]))


def of_model(given: Path, folder: Path) -> Path:
    """The buildings of a file as they are exported, without textures: what was read of it becomes charts, and these a file."""
    from catalogs.block.reader import read_block
    from facade_core.core.grouping import group_rows
    from facade_core.export.attribution import Attribution
    from facade_core.export.bodies.building_models import build_building_model_parts
    from facade_core.export.city_models.cityjson import VertexPool, build_geometry, empty_document
    from facade_core.export.models.settings import TEXTURED_MESHES
    from facade_core.export.models.textured_mesh import (
        TexturedMesh,
        filter_triangles,
        pack_charts_on_pages,
        triangle_areas,
    )
    from facade_core.geometry.block_surfaces import build_block_surfaces
    from facade_core.geometry.ground.terrain import build_terrain

    path = folder / "block.yaml"
    path.write_text(
        json.dumps({"name": "model", "buildings": {"path": str(given.resolve())}, "texture": {"walls": "translate"}})
    )
    block = read_block(path)
    terrain = build_terrain(block.buildings, None)
    charts, mesh, _ = build_block_surfaces(block.buildings, [], terrain=terrain, ground_margin=10, largest=150)
    mesh = filter_triangles(mesh, triangle_areas(mesh) > TEXTURED_MESHES.min_triangle_m2)
    texels = np.maximum(1, np.ceil(charts.size)).astype(np.int64)
    source = TexturedMesh(charts, mesh, charts.size, texels, lambda chart: np.zeros((1, 1, 3), np.uint8))
    drawn = pack_charts_on_pages(source, source.select_charts(np.arange(len(block.buildings))))
    pool = VertexPool(np.floor(mesh.vertices.min(axis=0)))
    city = empty_document("model", pool.origin, None, Attribution(()))
    for index, triangles in group_rows(charts.building[mesh.chart]).items():
        if index < 0:
            continue
        body = build_building_model_parts(drawn, triangles, {}, {}, pool.origin).body
        kind = "Solid" if body.is_solid else "MultiSurface"
        geometry = build_geometry(body.faces, body.surfaces, pool, "2", kind)
        geometry.pop("texture", None)
        city["CityObjects"][block.buildings[index].id] = {"type": "Building", "geometry": [geometry]}
    city["vertices"] = pool.tables([])["vertices"] if not pool.pages else [list(vertex) for vertex in pool.vertices]
    target = folder / "model.city.json"
    target.write_text(json.dumps(city))
    return target


def row(name: str, path: Path, validator: Path, seconds: float | None = None) -> dict[str, Any]:
    """What a CityJSON file holds, and the shares of its buildings and of all its objects that are valid; None without the
    validator."""
    city = json.loads(path.read_text())
    objects = city["CityObjects"].values()
    kinds = Counter(thing["type"] for thing in objects)
    built = [thing["geometry"][0] for thing in objects if thing["type"] == "Building" and thing.get("geometry")]
    openings: Counter[str] = Counter()
    for thing in objects:
        for geometry in thing.get("geometry", ()):
            surfaces = geometry.get("semantics", {}).get("surfaces", [])
            openings.update(one["type"] for one in surfaces if one["type"] in ("Window", "Door"))
    valid, errors = validated(path, validator)
    building = [valid[id] for id, thing in city["CityObjects"].items() if thing["type"] == "Building" and id in valid]
    return {
        "file": name,
        "buildings": kinds["Building"],
        "solids": sum(geometry["type"] == "Solid" for geometry in built),
        "valid_buildings_percent": round(100 * float(np.mean(building)), 1) if building else None,
        "valid_objects_percent": round(100 * float(np.mean(list(valid.values()))), 1) if valid else None,
        "objects_with_error": dict(sorted(errors.items())),
        "windows": openings["Window"],
        "doors": openings["Door"],
        "installations": kinds["BuildingInstallation"],
        "seconds": None if seconds is None else round(seconds, 1),
        "bytes": path.stat().st_size,
    }


def validated(path: Path, validator: Path) -> tuple[dict[str, bool], Counter[int]]:
    """Whether val3dity finds each object of a file valid, and in how many it finds each error; nothing where it is absent."""
    if not validator.is_file():
        return {}, Counter()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        command = [str(validator), str(path), "--report", str(report)]
        subprocess.run(command, capture_output=True, check=True)
        features = json.loads(report.read_text())["features"]
    errors = Counter(code for one in features for code in {error["code"] for error in one["errors"]})
    return {one["id"]: one["validity"] for one in features}, errors


if __name__ == "__main__":
    main()
