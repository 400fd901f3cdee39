"""A finished city, exported in each format and opened in a program of others.

    python -m benchmarks.city.exports CITY OUT [--only 3dtiles ...]

CITY is what `streetloom city` wrote; exports and pictures go to OUT. Each export is `streetloom export` in a process of its
own: seconds, processor seconds, memory at its peak, bytes. Then it is opened: 3D Tiles in CesiumJS (from above, at its own
error of 16 pixels; clicks, a picture), GeoPackage and orthophotos in GDAL, GeoParquet in GeoPandas, CityJSONSeq by cjio;
`facades` and `buildings` count what each file contains. `again` measures the same export a second time, with nothing changed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

from benchmarks.clients.browser import in_cesium
from benchmarks.process_usage import add_used, measure_family_mb, user_environment
from benchmarks.programs import chromium
from benchmarks.timing import bytes_in, figures

# Seconds between two looks at the processes.
LOOK_S = 0.2
SIDE_PX = 512
# The error at which CesiumJS refines tiles by itself.
ERROR_PX = 16.0
PLACES = [(x, y) for x in range(16, SIDE_PX, 32) for y in range(16, SIDE_PX, 32)]


def measure_export(city: Path, style: str, target: Path) -> dict[str, float]:
    """Measure `streetloom export` of a city in a process of its own: seconds, processor seconds, peak memory."""
    command = [sys.executable, "-m", "flows", "export", str(city), "--format", style, "--to", str(target)]
    begun, peak = time.time(), 0.0
    used: dict[int, tuple[str, float]] = {}
    with subprocess.Popen(command, env=user_environment(), stdout=subprocess.DEVNULL) as process:
        root = psutil.Process(process.pid)
        while process.poll() is None:
            add_used(root, used)
            peak = max(peak, measure_family_mb(process.pid))
            time.sleep(LOOK_S)
    if process.returncode:
        raise SystemExit(f"{city}: the export as {style} ended with {process.returncode}")
    return {
        "seconds": figures(time.time() - begun),
        "processor_s": figures(sum(seconds for _, seconds in used.values())),
        "peak_mb": round(peak),
    }


def open_tiles(target: Path) -> dict[str, Any]:
    """Open a tileset in CesiumJS from above, and keep a picture of it beside it."""
    from playwright.sync_api import sync_playwright

    with (
        sync_playwright() as playwright,
        chromium(playwright) as browser,
        in_cesium(browser, target, error=ERROR_PX, side=SIDE_PX) as opened,
    ):
        told = opened("figures()")
        picked = [opened(f"picked({x}, {y}, 'featureId_0')") for x, y in PLACES]
        opened.page.screenshot(path=str(target.with_suffix(".png")))
        complaints = len(opened.said) + len(told["failed"])
    return {
        "program": f"CesiumJS {told['version']}",
        "open_s": figures(opened.seconds),
        "tiles": len(list(target.rglob("*.glb"))),
        "loaded": told["loaded"],
        "complaints": complaints,
        "clicks_answered": sum(one is not None for one in picked),
        "texture_mb": figures(told["textures"] / 1e6),
    }


def open_geopackage(target: Path) -> dict[str, Any]:
    """Read every layer of a GeoPackage with GDAL."""
    import pyogrio

    begun = time.time()
    layers = [name for name, kind in pyogrio.list_layers(target) if kind is not None]
    counts = {name: len(pyogrio.read_dataframe(target, layer=name)) for name in layers}
    version = ".".join(map(str, pyogrio.__gdal_version__))
    return {"program": f"GDAL {version}", "open_s": figures(time.time() - begun)} | counts


def open_geoparquet(target: Path) -> dict[str, Any]:
    """Read every file of a folder of GeoParquet with GeoPandas."""
    import geopandas as gpd

    begun = time.time()
    counts = {file.stem: len(gpd.read_parquet(file)) for file in sorted(target.glob("*.parquet"))}
    return {"program": f"GeoPandas {gpd.__version__}", "open_s": figures(time.time() - begun)} | counts


def open_stream(target: Path) -> dict[str, Any]:
    """Collect a CityJSONSeq into one CityJSON file with cjio, and count its objects."""
    import cjio

    (path,) = target.glob("*.city.jsonl")
    collected = target.with_name(f"{target.name}-collected.city.json")
    program = "from cjio.cjio import cli; cli()"
    begun = time.time()
    command = [sys.executable, "-c", program, "--suppress_msg", "stdin", "save", str(collected)]
    with path.open() as lines:
        subprocess.run(command, stdin=lines, check=True, stdout=subprocess.DEVNULL)
    seconds = time.time() - begun
    kinds = [thing["type"] for thing in json.loads(collected.read_text())["CityObjects"].values()]
    return {
        "program": f"cjio {cjio.__version__}",
        "open_s": figures(seconds),
        "buildings": kinds.count("Building"),
        "objects": len(kinds),
    }


def open_orthophotos(target: Path) -> dict[str, Any]:
    """Read the mosaic of all facades and each orthophoto with GDAL."""
    import rasterio

    begun = time.time()
    files = sorted(target.rglob("*.tif"))
    posed = 0
    for file in files:
        with rasterio.open(file) as image:
            posed += bool(image.read(1).size) and {"world_origin", "world_along", "world_up"} <= image.tags().keys()
    return {
        "program": f"GDAL {rasterio.__gdal_version__}",
        "open_s": figures(time.time() - begun),
        "facades": len(files),
        "with_pose": posed,
    }


OPEN: dict[str, Callable[[Path], dict[str, Any]]] = {
    "3dtiles": open_tiles,
    "gpkg": open_geopackage,
    "geoparquet": open_geoparquet,
    "cityjsonseq": open_stream,
    "lod3": open_stream,
    "cog": open_orthophotos,
}


def measure(city: Path, out: Path, styles: list[str]) -> dict[str, Any]:
    """Measure the exports of a city, and what programs of others find in them."""
    found: dict[str, Any] = {}
    for style in styles:
        target = out / (f"{style}.gpkg" if style == "gpkg" else style)
        found[style] = measure_export(city, style, target)
        found[style]["mb"] = figures((target.stat().st_size if target.is_file() else bytes_in(target)) / 1e6)
        found[style] |= OPEN[style](target) | {"again": measure_export(city, style, target)}
        print(json.dumps({style: found[style]}), file=sys.stderr, flush=True)
    return found


def main() -> None:
    """Export a city in each format, open each, and print what that took as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("city", type=Path, help="a folder that `streetloom city` wrote")
    parser.add_argument("out", type=Path, help="a folder that is not there yet")
    parser.add_argument("--only", nargs="+", choices=OPEN, default=list(OPEN), help="formats [all]")
    asked = parser.parse_args()
    if asked.out.exists():
        raise SystemExit(f"{asked.out} is there already; name another folder")
    asked.out.mkdir(parents=True)
    load = round(os.getloadavg()[0], 1)
    found = measure(asked.city, asked.out, asked.only)
    print(
        json.dumps(
            {"benchmark": "exports of a city", "cores": os.cpu_count(), "load": load, "formats": found}, indent=1
        )
    )


if __name__ == "__main__":
    main()
