"""The facades of one building: from a photo, panoramas, own textures or an exemplar; seeds into the atlas."""

from __future__ import annotations

import base64
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from facade_core.atlas.provenance import resolve
from facade_core.atlas.rasters import Rasters, chart_digests, write_rasters
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.errors import FacadeError, ImageError
from facade_core.facade import Box, Facade, count_columns, from_exemplar, from_photo, things_in_front
from facade_core.ingest import Plan
from facade_core.labels import CLASSES
from facade_core.parse import parse
from facade_core.rectify import View, fuse_views, own_texture, rectify, rectify_view
from facade_core.types import Pose
from tasks.imagery import Imagery
from tasks.outcome import failure
from tasks.run import Run
from tasks.units.context import context, unit_seed, worker_name
from tasks.units.exemplar import read_exemplar
from tasks.units.images import focal_length, read_image, read_panorama, read_textures

# Texels around a photo's holes that count as hidden.
RIM = 2
# A facade of which pictures show less than this is made from an exemplar: there is too little to complete it from.
SHOWN = 0.3


@dataclass(frozen=True)
class _Evidence:
    """What pictures show of a facade: image (h, w, 3); hidden (h, w) bool; confidence (h, w), 0 to 1, the share of the
    raster's resolution that the picture has and how squarely it looks; name of the source; boxes of things masked; clean,
    whether nothing else can be in front."""

    image: np.ndarray
    hidden: np.ndarray
    confidence: np.ndarray
    source: str
    masked: tuple[Box, ...] = ()
    clean: bool = False


def facade_unit(
    run: Run,
    fork: Any,
    facades: Sequence[int],
    keys: Mapping[int, str],
    imagery: Mapping[int, Imagery],
    textures: Sequence[Path],
) -> tuple[Any, dict[int, dict[str, Any]]]:
    """All facades of one building, which may share chunks. imagery: facade -> its pictures; textures: the block's own.

    A facade that cannot be made is set aside with its reason; the others of the building are written.
    """
    start = time.time()
    plan = context(run).plan
    group: StoreGroup = zarr.open_group(fork.store)
    prepared = time.time()
    records: dict[int, dict[str, Any]] = {}
    for facade in facades:
        name = plan.facades.id[facade]
        record: dict[str, Any] = {"unit": name, "key": keys[facade], "worker": worker_name(), "started": start}
        try:
            made, source, confidence = _make(run, plan, group, facade, imagery[facade], textures)
        except Exception as error:
            records[facade] = failure(name, keys[facade], error) | record
            start = prepared = time.time()
            continue
        record |= {"status": "done", "source": source}
        stages = made.seconds if made is not None else {}
        seconds = {"prepare": prepared - start, "read": time.time() - prepared - sum(stages.values()), **stages}
        if made is not None:
            begun = time.time()
            digests = _write(group, plan, facade, made, confidence)
            seconds["write"] = time.time() - begun
            record |= _summary(made) | {"digests": digests}
        records[facade] = record | {"seconds": {stage: round(s, 4) for stage, s in seconds.items()}}
        start = prepared = time.time()
    return fork, records


def _make(
    run: Run, plan: Plan, group: StoreGroup, facade: int, imagery: Imagery, textures: Sequence[Path]
) -> tuple[Facade | None, str, np.ndarray]:
    """The facade from the best imagery there is of it, what that was, and how well it shows each texel, 0 to 255.

    None where it is left to the street stage.
    """
    facades, placement = plan.facades, plan.scene.placement
    chart = int(facades.chart[facade])
    size = (int(placement.height[chart]), int(placement.width[chart]))
    seed = unit_seed(run, facades.id[facade], "facade")
    evidence = _evidence(plan, chart, size, imagery, textures)
    if evidence is not None:
        made = from_photo(evidence.image, evidence.hidden, clean=evidence.clean, seed=seed)
        confidence = np.where(made.occluded, 0, np.rint(255 * evidence.confidence)).astype(np.uint8)
        return replace(made, masked=evidence.masked + made.masked), evidence.source, confidence
    if run.walls == "translate":
        return None, "translator", np.zeros(size, np.uint8)
    if imagery.exemplar is None:
        raise FacadeError(
            f"facade {facades.id[facade]}: no picture of it and no usable exemplar; add either to the block's imagery"
        )
    image, labels = read_exemplar(group, imagery.exemplar[0])
    made = from_exemplar(
        image,
        labels,
        (float(facades.height[facade]), float(facades.width[facade])),
        size,
        floors=int(facades.floors[facade]),
        metres_per_pixel=1 / run.texels_per_metre,
        seed=seed,
    )
    return made, imagery.exemplar[1], np.zeros(size, np.uint8)


def _evidence(
    plan: Plan, chart: int, size: tuple[int, int], imagery: Imagery, textures: Sequence[Path]
) -> _Evidence | None:
    """What pictures show of a facade; None where they show too little of it."""
    if imagery.photo is not None:
        image, hidden = photo_of(imagery.photo, imagery.rectified, size)
        hidden = _widened(hidden)
        return _Evidence(image, hidden, ~hidden, imagery.photo.name)
    if imagery.panoramas:
        views = [_view(plan, chart, path, pose, size) for path, pose in imagery.panoramas]
        fused = fuse_views(views)
        if (fused.seen & ~fused.occluded).mean() >= SHOWN:
            _, masked = things_in_front(fused.occluded)
            hidden = _widened(~fused.seen) | fused.occluded
            names = ", ".join(path.name for path, _ in imagery.panoramas)
            return _Evidence(fused.rgb, hidden, fused.confidence, names, masked)
    if imagery.own:
        images = read_textures(textures, plan.scene.mesh.texture[plan.scene.mesh.chart == chart])
        image, covered = own_texture(plan.scene, chart, images)
        if covered.mean() >= SHOWN:
            # what a model brings is its wall as its makers want it, and may be drawn: the parser is not asked for trees
            return _Evidence(image, ~covered, covered, "own texture", clean=True)
    return None


def photo_of(path: Path, rectified: bool, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A photo of a facade at a size, and what it does not show of it; rectified first where it is as taken."""
    import cv2

    image, hidden = read_image(path)
    if not rectified:
        alpha = np.where(hidden, 0, 255).astype(np.uint8)
        try:
            found = rectify(np.dstack([image, alpha]), focal=focal_length(path))
        except ImageError as error:
            raise ImageError(f"{path.name}: {error}") from error
        image, hidden = found.image, ~found.seen
    image = cv2.resize(image, size[::-1], interpolation=cv2.INTER_AREA)
    hidden = cv2.resize(hidden.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
    return image, hidden


def _view(plan: Plan, chart: int, path: Path, pose: Pose, size: tuple[int, int]) -> View:
    """A facade as a panorama shows it, with the trees, cars and people before it that the parser sees."""
    view = rectify_view(plan.scene, chart, read_panorama(path), pose, size)
    if not view.seen.any():
        return view
    alpha = np.where(view.seen, 255, 0).astype(np.uint8)
    in_front, _ = things_in_front(parse(np.dstack([view.rgb, alpha])).occluded & view.seen)
    return replace(view, occluded=in_front & view.seen)


def _widened(hidden: np.ndarray) -> np.ndarray:
    """A hole and its rim: beside it, resampling has mixed in what hides the wall."""
    import cv2

    return cv2.dilate(hidden.astype(np.uint8), np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8)).astype(bool)


def _write(group: StoreGroup, plan: Plan, facade: int, made: Facade, confidence: np.ndarray) -> dict[str, str]:
    """Write a facade's rasters and hierarchy; returns the digest of its chart."""
    scene, chart = plan.scene, int(plan.facades.chart[facade])
    rasters = Rasters.of(scene.placement, [chart])
    seed = made.image.reshape(-1, 3)
    evidence = made.provenance.reshape(-1)
    colour, provenance = resolve(seed, evidence, np.zeros_like(seed), np.zeros(len(seed), np.uint16))
    arrays = {
        "atlas/seed": seed,
        "atlas/seed_evidence": evidence,
        "atlas/colour": colour,
        "atlas/provenance": provenance,
        "facade_maps/evidence": made.evidence.reshape(-1, 3),
        "facade_maps/labels": made.labels.reshape(-1),
        "facade_maps/occluded": made.occluded.reshape(-1),
        "facade_maps/confidence": confidence.reshape(-1),
    }
    for name, flat in arrays.items():
        write_rasters(group[name], scene.spec, scene.placement, rasters, flat)
    group["hierarchies/data"][facade] = base64.b64encode(made.hierarchy.to_bytes()).decode()
    return chart_digests(colour, provenance, scene.placement, rasters, plan.ids)


def _summary(made: Facade) -> dict[str, Any]:
    """What the catalogue and the report say of a facade."""
    counts = {f"{c}s" if c != "balcony" else "balconies": 0 for c in ("window", "door", "balcony", "shop")}
    for element in made.elements:
        counts["balconies" if element.label == "balcony" else f"{element.label}s"] += 1
    labels = np.bincount(made.labels.reshape(-1), minlength=256)
    window = labels[CLASSES.index("window")]
    return {
        "elements": [
            [e.label, *(round(v, 1) for v in (e.x0, e.y0, e.x1, e.y1)), round(e.confidence, 3)] for e in made.elements
        ],
        "lattice": {"rows": list(map(int, made.lattice.rows)), "columns": list(map(int, made.lattice.columns))},
        "columns": count_columns(made.elements),
        **counts,
        "window_to_wall": round(float(window / labels.sum()), 4),
        "occluded": round(float(made.occluded.mean()), 4),
        "masked": [list(map(int, box)) for box in made.masked],
        "provenance": [
            round(float(v), 4) for v in np.bincount(made.provenance.reshape(-1), minlength=5) / made.labels.size
        ],
        "variation_types": int((made.hierarchy.levels[0].counts > 0).sum()),
        "variation_levels": len(made.hierarchy.levels),
        "variation_bytes": int(made.hierarchy.nbytes),
        "layout_score": None if made.completion is None else round(float(made.completion.score), 4),
    }
