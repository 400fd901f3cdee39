"""The rows of `benchmarks.clients`: a program and a format each."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property, partial
from math import inf
from pathlib import Path
from typing import Any

from benchmarks.clients import blender
from benchmarks.clients.browser import Opened, in_cesium, in_three
from benchmarks.clients.validators import gltf_issues
from benchmarks.programs import MissingProgramError, chromium
from benchmarks.solid import validated
from tasks.export.formats import export_run
from tasks.export.registry import FORMATS
from tasks.publish.published_run import open_published_run

COLUMNS = (
    *("client", "version", "format", "opened", "pictures", "attributes", "seconds", "mb", "texture_mb"),
    *("colour_difference", "edges_shared", "shown", "why"),
)
# The finest tiles are shown, from wherever one looks.
ERROR_PX, SIDE = 0.01, 512
PLACES = [(x, y) for x in range(32, SIDE, 32) for y in range(32, SIDE, 32)]
Row = dict[str, Any]


@dataclass(frozen=True)
class Exports:
    """Exports of a run, each made when it is first asked for, and what opens them; what is started ends with the stack."""

    out: Path
    folder: Path
    val3dity: Path
    stack: ExitStack

    def __call__(self, style: str, **options: Any) -> Path:
        """The folder of an export."""
        place = self.folder / "-".join([style, *(f"{name}-{value}" for name, value in options.items())])
        if not place.is_dir():
            print(f"exporting {place.name}", file=sys.stderr)
            export_run(self.out, style, place, **options)
        return place

    def main(self, style: str, **options: Any) -> Path:
        """The file to open first."""
        place = self(style, **options)
        return place / json.loads((place / "export.json").read_text())["files"][0]

    @cached_property
    def browser(self) -> Any:
        from playwright.sync_api import sync_playwright

        return self.stack.enter_context(chromium(self.stack.enter_context(sync_playwright())))


def _tiles_in_cesium(exports: Exports, style: str, **options: Any) -> Row:
    folder = exports(style, **options)
    with in_cesium(exports.browser, folder, error=ERROR_PX, side=SIDE) as opened:
        told = opened("figures()")
        whole = told["loaded"] == len(list((folder / "tiles").glob("*.glb"))) and not told["failed"] and not opened.said
        return _of(opened, folder) | {
            "version": told["version"],
            "opened": whole,
            "pictures": "all" if told["textures"] else "none",
            "attributes": _columns(opened, "picked({x}, {y}, 'featureId_0')"),
            "texture_mb": round(told["textures"] / 1e6, 1),
        }


def _tiles_in_three(exports: Exports, style: str, **options: Any) -> Row:
    folder = exports(style, **options)
    with in_three(exports.browser, folder, error=ERROR_PX, side=SIDE) as opened:
        told = opened("figures()")
        whole = told["models"] == len(list((folder / "tiles").glob("*.glb"))) and not told["failed"] and not opened.said
        return (
            _of(opened, folder) | _drawn(told) | {"opened": whole, "attributes": _columns(opened, "picked({x}, {y})")}
        )


def _model_in_three(exports: Exports, style: str, **options: Any) -> Row:
    model = exports.main(style, **options)
    with in_three(exports.browser, model, side=SIDE) as opened:
        told = opened("figures()")
        return (
            _of(opened, model) | _drawn(told) | {"opened": told["models"] == 1 and not told["failed"], "attributes": 0}
        )


def _of(opened: Opened, shown: Path) -> Row:
    return {"seconds": round(opened.seconds, 1), "mb": _mb(shown)}


def _mb(shown: Path) -> float:
    files = [shown] if shown.is_file() else [path for path in shown.rglob("*") if path.is_file()]
    return round(sum(path.stat().st_size for path in files) / 1e6, 1)


def _drawn(told: Row) -> Row:
    return {
        "version": told["version"],
        "pictures": f"{told['pictures']}" + (f", {len(told['bare'])} parts bare" if told["bare"] else ""),
        "texture_mb": round(told["textures"] / 1e6, 1),
    }


def _columns(opened: Opened, picked: str) -> int:
    """Columns that a facade answers with, the most of those in view."""
    found = [opened(picked.format(x=x, y=y)) for x, y in PLACES]
    return max((len(one) for one in found if one and one.get("kind") == "facade"), default=0)


def _in_blender(exports: Exports, style: str, **options: Any) -> Row:
    """A format in Blender, CityJSON as cjio writes it."""
    path = exports.main(style, **options)
    city = path if style in ("cityjson", "lod3") else None
    with open_published_run(exports.out) as found:
        camera, origin = blender.of_street(found), blender.origin_of_models(found)
        own, built = blender.own_picture(found, camera)
    if city:
        path, origin = blender.obj_by_cjio(city), blender.moved_by_cjio(city)
    shown = exports.folder / f"blender-{path.parent.name}.png"
    (told,) = blender.in_blender([{"open": str(path), "render": blender.shot(camera, origin, shown)}])
    return {
        "version": told["version"],
        "opened": told["triangles"] > 0,
        "pictures": f"{len(told['pictures'])}; {told['slots_with_picture']} of {told['slots']} parts",
        "attributes": len(told["attributes"]),
        "seconds": round(told["seconds"], 1),
        "mb": _mb(path.parent if city or style == "usd" else path),
        "texture_mb": round(told["texture_bytes"] / 1e6, 1),
        # the own picture has the light that lit materials leave out of their colours
        **({} if options.get("lit") else blender.compared(own, shown, built)),
    }


def _by_khronos(exports: Exports, style: str, **options: Any) -> Row:
    files = sorted(exports(style, **options).rglob("*.glb"))
    start = time.monotonic()
    issues = gltf_issues(*files)
    return {
        "opened": not any(one["numErrors"] for one in issues),
        "seconds": round(time.monotonic() - start, 1),
        "mb": round(sum(path.stat().st_size for path in files) / 1e6, 1),
        "why": f"{len(files)} files, {sum(one['numErrors'] for one in issues)} errors,"
        f" {sum(one['numWarnings'] for one in issues)} warnings",
    }


def _by_val3dity(exports: Exports, style: str) -> Row:
    if not exports.val3dity.is_file():
        raise MissingProgramError("val3dity is not there; name it with --val3dity")
    path = exports.main(style)
    start = time.monotonic()
    valid, errors = validated(path, exports.val3dity)
    return {
        "opened": all(valid.values()),
        "seconds": round(time.monotonic() - start, 1),
        "mb": _mb(path),
        "why": f"{sum(valid.values())} of {len(valid)} objects valid" + (f", errors {dict(errors)}" if errors else ""),
    }


def _tables(exports: Exports, style: str) -> Row:
    import pyogrio

    path = exports.main(style)
    start = time.monotonic()
    layers = [pyogrio.read_info(path, layer) for layer, _ in pyogrio.list_layers(path)]
    read = [len(pyogrio.read_dataframe(path, layer=layer["layer_name"])) for layer in layers]
    return {
        "version": ".".join(map(str, pyogrio.__gdal_version__)),
        "opened": all(found == layer["features"] for found, layer in zip(read, layers, strict=True)),
        "attributes": max(len(layer["fields"]) for layer in layers),
        "seconds": round(time.monotonic() - start, 1),
        "mb": _mb(path),
        "why": f"{len(layers)} layers, {sum(read)} features",
    }


def _walls(exports: Exports, style: str) -> Row:
    import rasterio

    files = sorted(exports(style).glob("*.tif"))
    start = time.monotonic()
    texels, posed = 0, 0
    for path in files:
        with rasterio.open(path) as image:
            texels += image.read(1).size
            posed += image.crs is not None and {"world_origin", "world_along", "world_up"} <= image.tags().keys()
    return {
        "version": rasterio.__gdal_version__,
        "opened": posed == len(files) > 0,
        "pictures": str(len(files)),
        "seconds": round(time.monotonic() - start, 1),
        "mb": round(sum(path.stat().st_size for path in files) / 1e6, 1),
        "texture_mb": round(3 * texels / 1e6, 1),
        "why": f"{posed} of {len(files)} with CRS and pose",
    }


def _by_gdal(exports: Exports, style: str) -> Row:
    return _tables(exports, style) if FORMATS[style].can_be_file else _walls(exports, style)


# Options that the programs are asked with, by format; each other format is exported without options.
_VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "3dtiles": {
        **{name: {"textures": name} for name in ("jpeg", "webp", "ktx2")},
        **{f"{name}, all texels": {"textures": name, "max_texture_mb": inf} for name in ("jpeg", "ktx2")},
        "jpeg, lit": {"textures": "jpeg", "lit": True},
        **{f"{name}, lit, night": {"textures": name, "night": True} for name in ("jpeg", "ktx2")},
    },
    "glb": {"lit": {"lit": True}, "unlit": {"lit": False}, "factored": {"textures": "factored"}},
    "usd": {"lit": {"lit": True}, "unlit": {"lit": False}},
}
# What asks a program about an export, by the program's name in the registry of formats.
_PROGRAMS: dict[str, Callable[..., Row]] = {
    "CesiumJS": _tiles_in_cesium,
    "3d-tiles-renderer": _tiles_in_three,
    "three.js": _model_in_three,
    "Khronos' validator": _by_khronos,
    "Blender": _in_blender,
    "cjio, Blender": _in_blender,
    "val3dity": _by_val3dity,
    "GDAL": _by_gdal,
}


def _checks() -> list[tuple[str, str, Callable[[Exports], Row]]]:
    """(program, format with its options, what asks)."""
    return [
        (program, f"{style}, {name}" if name else style, partial(_PROGRAMS[program], style=style, **options))
        for style, entry in FORMATS.items()
        for name, options in _VARIANTS.get(style, {"": {}}).items()
        for program in entry.opened_in
    ]


def rows(out: Path, folder: Path, val3dity: Path, only: frozenset[str]) -> list[Row]:
    """Each program that is here and format; a program that is absent, or fails, has a row that says why."""
    found: list[Row] = []
    with ExitStack() as stack:
        exports = Exports(out, folder, val3dity, stack)
        for client, style, ask in _checks():
            if only and not only & {client, style, style.partition(",")[0]}:
                continue
            row: Row = {"client": client, "format": style, "opened": False}
            try:
                row |= ask(exports)
            except MissingProgramError as absent:
                row["why"] = str(absent)
            except Exception as error:  # of whatever program or library: the other rows are asked for all the same
                row["why"] = str(error).splitlines()[0] if str(error) else type(error).__name__
            found.append(row)
            print(json.dumps(row), file=sys.stderr)
    return found
