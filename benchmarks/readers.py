"""Every reader on real data: seconds and memory per 1,000 buildings; and what the example blocks' geometry gives."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

BLOCKS = ("amsterdam-dam", "amsterdam-ij", "delfshaven", "ingolstadt", "plateau")


def main() -> None:
    """Read real files in every format, a process each, and plan the example blocks; prints one JSON object."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="the data folder")
    parser.add_argument("--one", type=Path, help="read one file only, and print its figures")
    parser.add_argument("--only", choices=("readers", "blocks"), help="one of the two, both without")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(_read(options.one)))
        return
    os.environ["STREETLOOM_DATA"] = str(options.data.resolve())
    result: dict[str, Any] = {"benchmark": "readers"}
    if options.only != "blocks":
        with tempfile.TemporaryDirectory() as folder:
            result["readers"] = [_apart(path) for path in _files(options.data / "city", Path(folder))]
    if options.only != "readers":
        blocks = [_block(name) for name in BLOCKS]
        totals = {name: sum(block[name] for block in blocks) for name in ("viewpoints", "viewpoints_inside_buildings")}
        result |= {"blocks": blocks, "all_blocks": totals}
    print(json.dumps(result, indent=1))


def _apart(path: Path) -> dict[str, Any]:
    """Read one file in a process of its own, so that its peak memory is its own."""
    command = [sys.executable, "-m", "benchmarks.readers", "--one", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def _read(path: Path) -> dict[str, Any]:
    """Read a file twice: the first time for its memory, the second, when all is imported and compiled, for its time."""
    from catalogs.readers.formats import read_buildings

    found, memory = _peak(lambda: read_buildings(path))
    count, faults = len(found.items), len(found.faults)
    del found
    start = time.perf_counter()
    read_buildings(path)
    seconds = time.perf_counter() - start
    return {
        "format": "".join(path.suffixes[-2:]) if path.suffix == ".json" else path.suffix,
        "file": path.name,
        "megabytes": round(path.stat().st_size / 1e6, 1),
        "buildings": count,
        "set_aside": faults,
        "seconds": round(seconds, 2),
        "seconds_per_1000": round(1000 * seconds / count, 2),
        "memory_mb": round(memory),
        "memory_mb_per_1000": round(1000 * memory / count),
    }


def _peak(work: Callable[[], Any]) -> tuple[Any, float]:
    """What `work` returns and by how many MB the process grew over it, its imports included."""
    import psutil

    process, done = psutil.Process(), threading.Event()
    before = process.memory_info().rss
    peak = [before]

    def watch() -> None:
        while not done.wait(0.005):
            peak.append(max(peak.pop(), process.memory_info().rss))

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        found = work()
    finally:
        done.set()
        watcher.join()
    return found, (max(peak[0], process.memory_info().rss) - before) / 1e6


def _files(city: Path, folder: Path) -> Iterator[Path]:
    """The real files, and the same buildings written in the other formats into `folder`."""
    yield city / "helsinki" / "Helsinki.osm.pbf"
    yield city / "helsinki" / "buildings_lod1.gpkg"
    for suffix, write in _footprint_writers(city / "helsinki" / "buildings_lod1.gpkg").items():
        path = folder / f"helsinki{suffix}"
        write(path)
        yield path
    yield city / "delfshaven" / "3-20-DELFSHAVEN.city.json"
    yield city / "delft" / "delft.city.json"
    yield _sequence(city / "delfshaven" / "3-20-DELFSHAVEN.city.json", folder / "delfshaven.city.jsonl")
    yield city / "plateau_textured" / "53392642_bldg_6697_op2.gml"
    yield _repeated(city / "ingolstadt" / "citygml_samples" / "4018213.xml", folder / "ingolstadt.gml", 500)
    yield city / "ingolstadt" / "lod2_shell.obj"
    yield city / "lyon" / "lod2.npz"
    yield from _meshes(city / "lyon" / "lod2.npz", folder)


def _footprint_writers(path: Path) -> dict[str, Callable[[Path], None]]:
    import geopandas

    frame = geopandas.read_file(path)
    return {
        ".geojson": lambda target: frame.to_crs(4326).to_file(target, driver="GeoJSON"),
        ".parquet": frame.to_parquet,
    }


def _sequence(path: Path, target: Path) -> Path:
    """A CityJSON file as a sequence of features with vertices of their own."""
    city = json.loads(path.read_text())
    head = {key: city[key] for key in ("type", "version", "transform", "metadata")} | {
        "CityObjects": {},
        "vertices": [],
    }
    with target.open("w") as file:
        file.write(json.dumps(head) + "\n")
        for id, thing in city["CityObjects"].items():
            number: dict[int, int] = {}

            def renumbered(node: Any, number: dict[int, int] = number) -> Any:
                return (
                    [renumbered(child) for child in node]
                    if isinstance(node, list)
                    else number.setdefault(node, len(number))
                )

            thing["geometry"] = [
                {key: value for key, value in geometry.items() if key != "texture"}
                | {"boundaries": renumbered(geometry["boundaries"])}
                for geometry in thing["geometry"]
            ]
            feature = {
                "type": "CityJSONFeature",
                "id": id,
                "CityObjects": {id: thing},
                "vertices": [city["vertices"][index] for index in number],
            }
            file.write(json.dumps(feature) + "\n")
    return target


def _repeated(path: Path, target: Path, times: int) -> Path:
    """A CityGML file with its building repeated under other ids, 1,000 being more than any sample holds."""
    text = path.read_text()
    start, end = text.index("<core:cityObjectMember>"), text.rindex("</core:cityObjectMember>") + 24
    member = text[start:end]
    with target.open("w") as file:
        file.write(text[:start])
        for number in range(times):
            file.write(member.replace("4018213", f"b{number}"))
        file.write(text[end:])
    return target


def _meshes(path: Path, folder: Path) -> Iterator[Path]:
    """Lyon's triangles as OBJ with a group per building, as GLB and as PLY."""
    import trimesh

    from catalogs.features import BuildingModels
    from catalogs.readers.formats import read_buildings

    with np.load(path) as city:
        triangles, feature = city["triangles"].astype(np.float64), city["feature"]
    obj = folder / "lyon.obj"
    with obj.open("w") as file:
        for group in np.split(np.arange(len(feature)), np.flatnonzero(np.diff(feature)) + 1):
            file.write(f"g {feature[group[0]]}\n")
            np.savetxt(file, triangles[group].reshape(-1, 3), fmt="v %.3f %.3f %.3f")
            first = 3 * int(group[0]) + 1
            corners = np.arange(first, first + 3 * len(group)).reshape(-1, 3)
            np.savetxt(file, corners, fmt="f %d %d %d")
    yield obj
    scene = trimesh.Scene()
    city = read_buildings(path)
    assert isinstance(city, BuildingModels)
    models = city.items[:1000]
    for model in models:
        y_up = model.shell.vertices[:, [0, 2, 1]] * [1, 1, -1]
        mesh = trimesh.Trimesh(y_up, model.shell.triangles, process=False)
        scene.add_geometry(mesh, node_name=model.id, geom_name=model.id)
    glb = folder / "lyon_1000.glb"
    glb.write_bytes(scene.export(file_type="glb"))
    yield glb
    ply = folder / "lyon_1000.ply"
    corners = np.concatenate([model.shell.vertices[model.shell.triangles].reshape(-1, 3) for model in models])
    trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False).export(ply)
    yield ply


def _block(name: str) -> dict[str, Any]:
    """What the geometry of an example block gives: heights by source, viewpoints, walls that a street owns."""
    import shapely

    from catalogs.block.reader import read_block
    from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER as FOLDER
    from facade_core.geometry.charts import ChartKind
    from tasks.stages.ingest.planning import make_plan

    start = time.perf_counter()
    block = read_block(FOLDER / f"{name}.yaml")
    read = time.perf_counter() - start
    plan = make_plan(replace(block, texture=replace(block.texture, panorama_width=512)))
    charts, facades = plan.scene.charts, plan.facades
    footprints = shapely.union_all([building.footprint for building in block.buildings])
    places = shapely.points([viewpoint.position[:2] for viewpoint in plan.viewpoints])
    normal = charts.normals()
    middle = charts.points(np.arange(len(charts)), *charts.size.T / 2)
    before = shapely.points((middle + 0.5 * normal)[:, :2])
    large = (charts.kind == ChartKind.WALL) & (charts.size[:, 0] >= 3.0) & (charts.size[:, 1] >= 2.5)
    free = large & ~shapely.intersects(footprints, before)
    owned = np.zeros(len(charts), bool)
    owned[facades.chart] = True
    return {
        "block": name,
        "buildings": len(block.buildings),
        "heights_by_source": dict(Counter(building.height_source for building in block.buildings)),
        "set_aside": len(block.faults),
        "streets": len(plan.streets),
        "streets_derived": not block.streets,
        "street_metres": round(sum(street.line.length for street in plan.streets)),
        "viewpoints": len(plan.viewpoints),
        "viewpoints_inside_buildings": int(shapely.intersects(footprints, places).sum()),
        "walls": int(large.sum()),
        "walls_with_a_street": int(owned.sum()),
        "walls_in_the_open": int(free.sum()),
        "share_in_the_open_with_a_street": round(float((owned & free).sum() / max(1, free.sum())), 3),
        "facades_shown_by_panoramas": len(np.unique(plan.sightings.facade)),
        "seconds_read": round(read, 2),
        "seconds_plan": round(time.perf_counter() - start - read, 2),
        "pages": plan.scene.spec.pages,
    }


if __name__ == "__main__":
    main()
