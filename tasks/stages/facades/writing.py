"""Writing of a facade: its rasters and files, and the fields of its record."""

from __future__ import annotations

import time
from io import BytesIO
from typing import NamedTuple

import numpy as np

from facade_core.atlas.rasters import (
    TexelLayout,
    chart_digests,
    describe_completeness,
    picture_digest,
    write_rasters,
)
from facade_core.atlas.stored_files import (
    digest_stored_file,
    earlier_picture_path,
    variation_hierarchy_path,
    write_stored_file,
)
from facade_core.core.arrays import AnyArray, UInt8Array
from facade_core.core.labels import ELEMENT_PLURALS, FacadeClass
from facade_core.core.provenance import PROVENANCE, Provenance
from facade_core.core.types import AS_FOUND, Element
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.bodies.settings import element_depth
from facade_core.facade.evidence import Evidence
from facade_core.facade.exemplar import count_columns
from facade_core.facade.facade import Facade
from facade_core.facade.layout.settings import MIN_PLAUSIBLE_SCORE
from facade_core.facade.photo_facade import MAX_HIDDEN_SHARE
from facade_core.facade.texture_faults import inpainted_radius
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.geometry.walls import WallRole
from facade_core.imagery.detect.detection import detectors_available
from facade_core.imagery.detect.signs import shop_names
from facade_core.imagery.privacy import apply_privacy
from facade_core.imagery.rectify.change_detection import ChangeSinceCapture
from facade_core.parsing.confidence import box_coverage
from facade_core.plan.plan import Plan
from tasks.stages.facades.exposure import first_picture, measure_pictured_colour
from tasks.stages.facades.imagery import FacadeInputs
from tasks.stages.facades.photos import describe_crop
from tasks.stages.facades.record import count_variations

# What `facade_core.parsing.confidence.FacadeStatistics` has, as the catalogue names it.
_ESTIMATED = ("window_to_wall", "windows", "floors")


class TexturedFacade(NamedTuple):
    """A textured facade.

    Attributes
    ----------
    kind : its source as of `iterate_sources`; empty without pictures.
    facade : None if it is left plain.
    source : name of the source.
    confidence : (h, w) uint8.
    evidence : what its pictures show; None without pictures.
    """

    kind: str
    facade: Facade | None
    source: str
    confidence: UInt8Array
    evidence: Evidence | None = None


def write_facade(
    group: StoreGroup,
    plan: Plan,
    facade: int,
    inputs: FacadeInputs,
    made: TexturedFacade,
    seconds: dict[str, float],
) -> dict[str, object]:
    """Write a facade; returns the fields of its record.

    Parameters
    ----------
    seconds : duration of the steps so far; the record has that of writing too.
    """
    result, shown, corrected = made.facade, made.evidence, inputs.corrected
    about: dict[str, object] = {"source": made.source, "capture_date": None if shown is None else shown.captured}
    if corrected != AS_FOUND and (result is not None or not corrected.facade):
        about |= {"corrected": True} | ({} if corrected.facade else {"facade": False})
    if result is not None:
        begun = time.time()
        files: dict[str, str] = {}
        density = float(plan.scene.placement.texels_per_metre[plan.facades.chart[facade]])
        evidence = apply_privacy(result.evidence, result.occluded, inputs.privacy, density)
        digests = _write_rasters(group, plan, facade, result, evidence, made.confidence)
        about |= _summarize(result, density) | {"digests": digests, "label_digest": picture_digest(result.labels)}
        if result.hierarchy is not None:
            about |= _write_variations(group, plan, facade, result.hierarchy, files)
        seconds = seconds | {"write": time.time() - begun}
        if shown is not None:
            about |= _describe_pictures(result, shown, made, inputs, density)
            about |= {} if shown.before is None else _write_change(group, plan, facade, shown.before, files)
            about |= describe_crop(shown)
        about |= {"files": files, **describe_completeness([result.provenance])}
    about["seconds"] = {stage: round(s, 4) for stage, s in seconds.items()}
    return about


def _describe_pictures(
    result: Facade, shown: Evidence, made: TexturedFacade, inputs: FacadeInputs, texels_per_metre: float
) -> dict[str, object]:
    """Return the fields of a record on the photo or panoramas of a facade; none for textures of the model."""
    if made.kind not in ("photo", "panoramas"):
        return {}
    names = _read_shop_names(result, shown, made.kind, texels_per_metre)
    about: dict[str, object] = {"privacy": inputs.privacy, "looked": detectors_available(), "shop_names": names}
    if (colour := measure_pictured_colour(result, texels_per_metre)) is not None:
        about["pictured_colour"] = colour
    if made.kind == "panoramas" and first_picture(made.source) in {p.name for p in inputs.exposure_factors}:
        about["common_exposure"] = True
    return about


def _read_shop_names(result: Facade, evidence: Evidence, source: str, texels_per_metre: float) -> str | None:
    """Return the names of shops on a facade's own photo; None without a photo or detectors."""
    if source != "photo" or not detectors_available():
        return None
    seen = evidence.seen
    return "; ".join(shop_names(seen.lines, result.labels, result.occluded, seen.plates, texels_per_metre))


def _write_variations(
    group: StoreGroup, plan: Plan, facade: int, hierarchy: Hierarchy, files: dict[str, str]
) -> dict[str, object]:
    """Store the variations of a facade and add their file to `files`; returns the fields of its record."""
    path, data = variation_hierarchy_path(int(plan.ids[plan.facades.chart[facade]])), hierarchy.to_bytes()
    write_stored_file(group, path, data, f"variations of {plan.facades.id[facade]}")
    files[path] = digest_stored_file(data)
    return {"variation_file": path, "variation_digest": files[path]}


def _write_change(
    group: StoreGroup, plan: Plan, facade: int, before: ChangeSinceCapture, files: dict[str, str]
) -> dict[str, object]:
    """Return the fields of a record on a change, and store the picture of the facade before; adds it to `files`."""
    from PIL import Image

    told: dict[str, object] = {
        "changed": before.changed,
        "compared": before.compared,
        "capture_date_before": before.day,
    }
    if before.cells:
        told["change_map"] = list(before.cells)
    if before.picture is not None:
        file = BytesIO()
        Image.fromarray(before.picture).save(file, "WEBP", quality=72, method=2)
        path = earlier_picture_path(int(plan.ids[plan.facades.chart[facade]]))
        write_stored_file(group, path, file.getvalue(), f"{plan.facades.id[facade]} as it was before")
        files[path] = digest_stored_file(file.getvalue())
        told |= {"before_file": path, "before_digest": files[path]}
    return told


def _write_rasters(
    group: StoreGroup, plan: Plan, facade: int, result: Facade, shown: UInt8Array, confidence: UInt8Array
) -> dict[str, str]:
    """Write a facade's rasters; returns its chart's digest."""
    scene, chart = plan.scene, int(plan.facades.chart[facade])
    rasters = TexelLayout.of_charts(scene.placement, [chart])
    seed = result.image.reshape(-1, 3)
    evidence = result.provenance.reshape(-1)
    arrays: dict[str, AnyArray] = {
        "atlas/seed": seed,
        "atlas/seed_evidence": evidence,
        "facade_maps/labels": result.labels.reshape(-1),
    }
    # of others there is no more to tell: nothing is kept twice
    if plan.facades.role[facade] == WallRole.STREET or (result.provenance == Provenance.PHOTO).any():
        arrays |= {
            "facade_maps/evidence": shown.reshape(-1, 3),
            "facade_maps/occluded": result.occluded.reshape(-1),
            "facade_maps/confidence": confidence.reshape(-1),
        }
    for name, flat in arrays.items():
        write_rasters(group[name], scene.spec, scene.placement, rasters, flat)
    return chart_digests(seed, evidence, scene.placement, rasters, plan.ids)


def _measure_faults(result: Facade, texels_per_metre: float) -> dict[str, float]:
    """Return the fields of a record on faults of a finished texture; {} without pictures."""
    if result.foreign_share is None or result.inpainting_doubt is None:
        return {}
    radius = inpainted_radius(result.provenance == Provenance.INPAINTED) / texels_per_metre
    return {
        "foreign_share": round(result.foreign_share, 4),
        "doubtful_inpainting_m": round(radius * result.inpainting_doubt, 4),
    }


def _describe_element(element: Element, texels_per_metre: float) -> list[str | float]:
    """Return an element's class, box in texels, confidence, depth in metres and what the depth rests on."""
    box = (round(side, 1) for side in (element.x0, element.y0, element.x1, element.y1))
    depth = element_depth(element, texels_per_metre)
    return [element.label, *box, round(element.confidence, 3), depth.outward_m, depth.source]


def _summarize(result: Facade, texels_per_metre: float) -> dict[str, object]:
    """Return the record fields of a facade for the catalogue and the report."""
    pictured = result.provenance == Provenance.PHOTO
    counts: dict[str, int] = {}
    for name, plural in ELEMENT_PLURALS.items():
        own = [element for element in result.elements if element.label == name]
        counts[plural] = len(own)
        counts[f"{plural}_seen"] = sum(box_coverage(~pictured, element) <= MAX_HIDDEN_SHARE for element in own)
    told: dict[str, object] = {
        "window_to_wall": round(float((result.labels == FacadeClass.WINDOW).mean()), 4),
        "floors": result.floors,
    }
    if result.estimates is not None:
        for name, low, high in zip(_ESTIMATED, result.estimates.low, result.estimates.high, strict=True):
            if name == "floors" and not result.floors:  # without windows only the map tells
                continue
            told |= {f"{name}_low": round(low, 4), f"{name}_high": round(high, 4)}
    return {
        "elements": [_describe_element(element, texels_per_metre) for element in result.elements],
        "lattice": {"rows": list(map(int, result.lattice.rows)), "columns": list(map(int, result.lattice.columns))},
        "depths_measured": sum(element.depth_m is not None for element in result.elements),
        "columns": count_columns(result.elements),
        "shop_width": round(float((result.labels == FacadeClass.SHOP).any(axis=0).mean()), 4),
        **counts,
        **told,
        "occluded": round(float(result.occluded.mean()), 4),
        "masked": [list(map(int, box)) for box in result.masked],
        "masked_share": round(result.masked_share, 4),
        "provenance": [
            round(float(share), 4)
            for share in np.bincount(result.provenance.reshape(-1), minlength=len(PROVENANCE)) / result.labels.size
        ],
        "implausible": result.plausibility is not None and result.plausibility < MIN_PLAUSIBLE_SCORE,
        "layout_score": None if result.completion is None else round(float(result.completion.score), 4),
        **_measure_faults(result, texels_per_metre),
    } | ({} if result.hierarchy is None else count_variations(result.hierarchy))
