"""A published block as a factored model: what `facade_core.factored` makes of its facades, and the rest on pages."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalogs.block import read_block
from facade_core.errors import FacadeError, InputError
from tasks.export.features import features_of
from tasks.progress import advance, begin_stage
from tasks.published.opened import Published
from tasks.store.standing import recorded_source
from tasks.units.images import read_exemplar_picture

if TYPE_CHECKING:
    from facade_core.factored.glb import Part
    from facade_core.factored.library import Library
    from facade_core.factored.wall import Facade, Pieces

FIGURES = "figures.json"
# Of the levels of the variations the one whose types are shown: as photographed.
LEVEL = 0
# A given exemplar is the stored one where they differ by no more grey levels, at the stored one's size.
SAME = 4.0


def write_factored(
    found: Published, buildings: np.ndarray, shown: np.ndarray, folder: Path
) -> tuple[list[str], list[str]]:
    """block.glb with a node a building, whose facades are factored; figures.json, what it comes to. shown: the
    buildings, and -1 for the ground."""
    from facade_core.export.encoders import encoder
    from facade_core.export.models import local_frame
    from facade_core.factored.glb import factored_glb
    from facade_core.factored.parts import joined, parts_of, rest
    from facade_core.factored.pictures import held, pictures_of

    start = time.monotonic()
    source = found.textured
    facades = _planes(found, buildings)
    libraries, of, notes = _libraries(found, list(facades))
    begin_stage("export", len(facades) + 1)
    pieces_of: dict[int, Pieces] = {}
    for index in facades:
        _lay(found, index, facades[index], libraries, of[index], pieces_of)
        advance("export", 1)
    whole = joined(pieces_of.values())
    pictures = pictures_of(whole, libraries)
    frame = local_frame(found.plan.scene.mesh)
    parts: dict[int, dict[int, Part]] = {}
    for building, pieces in sorted(pieces_of.items()):
        parts[building] = parts_of(pieces, pictures, frame)
    laid = {int(found.plan.facades.chart[index]) for index in facades}
    others = np.setdiff1d(source.chosen(shown), np.array(sorted(laid), np.int64))
    pages, elements_held = rest(source, others, len(pictures.pictures), parts, frame), held(pictures.pictures)
    every = [*pictures.pictures, *pages]
    used = encoder("jpeg")
    encoded = [used.encode(picture) for picture in every]
    names = {-1: "ground", **found.names}
    order = sorted(parts, key=lambda building: (building < 0, building))
    data = factored_glb(
        {names[building]: parts[building] for building in order},
        encoded,
        [*pictures.repeated, *[False] * len(pages)],
        used,
        features_of(found),
        extras={"origin": frame.origin.tolist(), "crs": found.crs},
        copyright=found.attribution.line,
    )
    (folder / "block.glb").write_bytes(data)
    density = np.array([density * pictures.scale[key] for key, density in whole.elements] or [0.0])
    told = {
        "bytes": len(data),
        "picture_bytes": sum(map(len, encoded)),
        "texture_mb": round(held(every) / 1e6, 1),
        "texture_mb_of_grains": round(held([p for p, r in zip(every, pictures.repeated, strict=False) if r]) / 1e6, 1),
        "texture_mb_of_elements": round(
            (elements_held - held([p for p, r in zip(every, pictures.repeated, strict=False) if r])) / 1e6, 1
        ),
        "texture_mb_of_the_rest": round(held(pages) / 1e6, 1),
        "elements": len(whole.elements),
        "types": len({key for key, _ in whole.elements}),
        "texels_per_metre_of_elements": {
            str(q): round(float(np.percentile(density, q)), 1) for q in (5, 25, 50, 75, 95)
        },
        "triangles": sum(len(part.triangles) for own in parts.values() for part in own.values()),
        "draw_calls": sum(map(len, parts.values())),
        "buildings": len(buildings),
        "facades": len(facades),
        "seconds": round(time.monotonic() - start, 1),
    }
    (folder / FIGURES).write_text(json.dumps(told, indent=1) + "\n")
    advance("export", 1)
    return ["block.glb"], notes


def _planes(found: Published, buildings: np.ndarray) -> dict[int, list[Any]]:
    """The facades with a finished layout whose walls are plane: their polygons."""
    from facade_core.export.openings import outlines
    from facade_core.factored.wall import Plane, flat
    from facade_core.grouping import grouped

    source = found.textured
    of_chart = grouped(source.mesh.chart)
    planes = {}
    for index in found.rectified(buildings):
        chart = int(found.plan.facades.chart[index])
        triangles = source.mesh.triangles[of_chart.get(chart, np.zeros(0, np.int64))]
        corners = source.mesh.vertices[triangles]
        own = [Plane(outline, corners.reshape(-1, 3)) for outline in outlines(source.coordinates[triangles])]
        if own and all(map(flat, own)):
            planes[index] = own
    return planes


def _libraries(found: Published, facades: Sequence[int]) -> tuple[list[Library], dict[int, int], list[str]]:
    """A library for each exemplar that the facades are made from, and for each facade with a picture of its own; whose is
    whose."""
    from facade_core.export.facade_stages import chart_raster
    from facade_core.factored.library import library_of
    from facade_core.parse import elements

    exemplars = {r["unit"]: k for k, r in enumerate(found.journals["exemplars"]) if r and r["status"] == "done"}
    given = _given(found)
    libraries: list[Library] = []
    number: dict[str, int] = {}
    of: dict[int, int] = {}
    coarse = 0
    placement = found.plan.scene.placement
    begin_stage("libraries", len({_source(found, index) for index in facades}))
    for index in facades:
        source = _source(found, index)
        if source not in number:
            if source in exemplars:
                k = exemplars[source]
                image, labels = (found.group[f"exemplars/{k}/{name}"][:] for name in ("image", "labels"))
                fine = _fine(given.get(source), image)
                coarse += fine is None
                density = 1 / float(found.journals["exemplars"][k]["metres_per_texel"])  # type: ignore[index]
                made = library_of(image, labels, elements(labels), density, fine, seed=k)
            else:
                chart = int(found.plan.facades.chart[index])
                image, labels = (
                    chart_raster(found.group, placement, chart, name) for name in ("atlas/seed", "facade_maps/labels")
                )
                density = float(placement.texels_per_metre[chart])
                made = library_of(image, labels, found.elements(index), density, seed=chart)
            number[source] = len(libraries)
            libraries.append(made)
            advance("libraries", 1)
        of[index] = number[source]
    notes = []
    if coarse:
        notes = [
            f"{coarse} exemplars are not where the block file says, or show something that was made anew: their elements "
            "have no more texels than the store"
        ]
    return libraries, of, notes


def _source(found: Published, index: int) -> str:
    record = found.records[index]
    assert record is not None  # it has a layout
    return str(record["source"])


def _given(found: Published) -> dict[str, Path]:
    """The exemplars by name as they were given, where they still are."""
    path = recorded_source(found.snapshot.out)
    if path is None:
        return {}
    try:
        return {exemplar.stem: exemplar for exemplar in read_block(path).exemplars}
    except InputError:
        return {}


def _fine(path: Path | None, image: np.ndarray) -> np.ndarray | None:
    """A given exemplar with all its pixels; None where it is not what was stored, or has no more. What hid a facade, or is
    private, was made anew before it was stored: such an exemplar is not taken."""
    from facade_core.resizing import resized

    if path is None:
        return None
    try:
        fine = read_exemplar_picture(path).rgb
    except (FacadeError, OSError):
        return None
    if fine.shape[0] <= image.shape[0]:
        return None
    off = np.abs(resized(fine, image.shape[:2]).astype(np.int16) - image).mean(axis=2)
    return fine if float(np.percentile(off, 99.5)) <= SAME else None


def _lay(
    found: Published,
    index: int,
    planes: Sequence[Any],
    libraries: Sequence[Library],
    number: int,
    pieces_of: dict[int, Pieces],
) -> None:
    from facade_core.factored.wall import Pieces, lay

    source = found.textured
    building = int(found.plan.facades.building[index])
    own = source.charts.building[source.mesh.chart] == building
    behind = [source.mesh.vertices[source.mesh.triangles[own]]]
    pieces = pieces_of.setdefault(building, Pieces())
    lay(_facade(found, index), planes, source.charts, libraries[number], number, LEVEL, behind, pieces)


def _facade(found: Published, index: int) -> Facade:
    from facade_core.export.facade_stages import chart_raster
    from facade_core.factored.wall import Facade

    placement, chart = found.plan.scene.placement, int(found.plan.facades.chart[index])
    seed, labels = (chart_raster(found.group, placement, chart, name) for name in ("atlas/seed", "facade_maps/labels"))
    density = float(placement.texels_per_metre[chart])
    return Facade(chart, seed, found.textured.raster(chart), labels, found.elements(index), density)
