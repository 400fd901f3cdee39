"""Worker of `facades`: texture the facades of one building from pictures or an exemplar, and write the base layer."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from io import BytesIO
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record, read_records
from facade_core.atlas.rasters import TexelLayout, chart_digests, write_rasters
from facade_core.atlas.store import open_root
from facade_core.atlas.stored_files import (
    digest_stored_file,
    earlier_picture_path,
    variation_hierarchy_path,
    write_stored_file,
)
from facade_core.core.arrays import AnyArray, Float64Array, UInt8Array
from facade_core.core.errors import FacadeError, ImageError
from facade_core.core.labels import ELEMENT_PLURALS, FacadeClass
from facade_core.core.provenance import PROVENANCE, Provenance
from facade_core.core.types import AS_FOUND
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.correction import rasterise_boxes, replace_elements
from facade_core.facade.evidence import Evidence
from facade_core.facade.exemplar import count_columns
from facade_core.facade.facade import Facade
from facade_core.facade.photo_facade import MAX_HIDDEN_SHARE, MappedDoors, build_facade_from_photo
from facade_core.geometry.walls import WallRole
from facade_core.imagery.detect.detection import detectors_available
from facade_core.imagery.detect.signs import shop_names
from facade_core.imagery.privacy import apply_privacy
from facade_core.imagery.rectify.change_detection import ChangeSinceCapture
from facade_core.parsing.confidence import box_coverage
from facade_core.plan.plan import Plan
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.outcome import (
    collect_input_errors,
    error_reason,
    failure_record,
    is_machine_fault,
    rejection_record_fields,
)
from tasks.engine.run import Run
from tasks.engine.seeds import FACADE_SEED, unit_seed
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.exemplar_facades import build_unit_from_exemplar
from tasks.stages.facades.exposure import first_picture, level_exposures, measure_pictured_colour
from tasks.stages.facades.photos import describe_crop
from tasks.stages.facades.picture_detail import sharpen_from_pictures, working_size
from tasks.stages.facades.pictured_style import PicturedStyle, select_pictured_style
from tasks.stages.facades.record import FacadeRecord, count_variations
from tasks.stages.facades.wall_colour import photo_wall_colour

if TYPE_CHECKING:
    from tasks.stages.facades.imagery import FacadeImagery


# What `facade_core.parsing.confidence.FacadeStatistics` has, as the catalogue names it.
_ESTIMATED = ("window_to_wall", "windows", "floors")


class TexturedFacade(NamedTuple):
    """A textured facade.

    Attributes
    ----------
    depth : index of its source in the order of trying.
    facade : None if it is left to the street stage.
    source : name of the source.
    confidence : (h, w) uint8.
    evidence : what its pictures show; None without pictures.
    """

    depth: int
    facade: Facade | None
    source: str
    confidence: UInt8Array
    evidence: Evidence | None = None


def process_facades(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Texture the pending facades of one building, which may share chunks; returns the fork and the records.

    If a picture is rejected the next source is taken, and the record names the reason. A facade that cannot be made is recorded
    as failed; the others of the building are written. Unit arguments: imagery of the facade, texture files of
    the block, and the
    other facades of the building with pictures.
    """
    start = time.time()
    plan = load_run_plan(run)
    group = open_root(fork)
    prepared = time.time()
    records: dict[int, Record] = {}
    left: list[tuple[Unit, list[Exception]]] = []

    def make_and_record(unit: Unit, make: Callable[[], TexturedFacade | None], refused: list[Exception]) -> bool:
        """Make a facade and keep its record; False where `make` has none."""
        nonlocal start, prepared
        about: dict[str, object] = {"worker": current_worker_name(), "started": start}
        try:
            made = make()
        except Exception as error:
            if is_machine_fault(error):
                raise
            records[unit.index] = failure_record(unit.name, unit.key, _join_errors([*refused, error])) | about  # type: ignore[assignment]
        else:
            if made is None:
                start = prepared = time.time()
                return False
            about |= rejection_record_fields(refused, _describe_source(unit.arguments[0], made.depth, made.source))
            stages = made.facade.seconds if made.facade is not None else {}
            seconds = {"prepare": prepared - start, "read": time.time() - prepared - sum(stages.values()), **stages}
            about |= _write_facade(run, plan, group, unit, made, seconds)
            records[unit.index] = Record(unit=unit.name, key=unit.keys[made.depth], status="done", **about)  # type: ignore[typeddict-item]
        start = prepared = time.time()
        return True

    for unit in units:
        refused: list[Exception] = []
        if not make_and_record(unit, partial(texture_from_pictures, run, plan, unit, refused), refused):
            left.append((unit, refused))
    level_exposures(group, plan, records, {unit.index: unit.arguments[2] for unit in units})
    wall_colour = cache(partial(photo_wall_colour, group, plan))

    def source_name(facade: int) -> str:
        known = records.get(facade) or read_records(group, "facades", np.array([facade]))[0]
        return str(cast(FacadeRecord, known).get("source") or "") if known else ""

    own_style = cache(partial(select_pictured_style, group, plan, source_name))
    for unit, refused in left:  # once those with pictures are there: these take their walls' colour
        beside = [
            facade for facade in unit.arguments[2] if facade not in records or records[facade]["status"] == "done"
        ]
        make_and_record(
            unit,
            partial(_texture_from_exemplar, run, plan, group, unit, wall_colour, own_style, tuple(beside)),
            refused,
        )
    return fork, records


def _write_facade(
    run: Run,
    plan: Plan,
    group: StoreGroup,
    unit: Unit,
    made: TexturedFacade,
    seconds: dict[str, float],
) -> dict[str, object]:
    """Write a facade; returns the fields of its record.

    Parameters
    ----------
    seconds : duration of the steps so far; the record has that of writing too.
    """
    facade, imagery, result, shown = unit.index, unit.arguments[0], made.facade, made.evidence
    about: dict[str, object] = {"source": made.source, "capture_date": None if shown is None else shown.captured}
    if imagery.corrected != AS_FOUND and (result is not None or not imagery.corrected.facade):
        about |= {"corrected": True} | ({} if imagery.corrected.facade else {"facade": False})
    if result is not None:
        begun = time.time()
        density = float(plan.scene.placement.texels_per_metre[plan.facades.chart[facade]])
        evidence = apply_privacy(result.evidence, result.occluded, run.privacy, density)
        digests = _write_rasters(group, plan, facade, result, evidence, made.confidence)
        seconds = seconds | {"write": time.time() - begun}
        about |= _summarize(result) | {"digests": digests}
        if result.hierarchy is not None:
            about["variation_file"] = variation_hierarchy_path(int(plan.ids[plan.facades.chart[facade]]))
            about["variation_digest"] = digest_stored_file(result.hierarchy.to_bytes())
        if shown is not None and (source := imagery.sources()[made.depth]) in ("photo", "panoramas"):
            names = _read_shop_names(result, shown, source, density)
            about |= {"privacy": run.privacy, "looked": detectors_available(), "shop_names": names}
            colour = measure_pictured_colour(result, density)
            about |= {} if colour is None else {"pictured_colour": colour}
            if first_picture(made.source) in {path.name for path in imagery.exposure_factors}:
                about["common_exposure"] = True
        if shown is not None:
            about |= {} if shown.before is None else _write_change(group, plan, facade, shown.before)
            about |= describe_crop(shown)
    about["seconds"] = {stage: round(s, 4) for stage, s in seconds.items()}
    return about


def _write_change(group: StoreGroup, plan: Plan, facade: int, before: ChangeSinceCapture) -> dict[str, object]:
    """Return the fields of a record on a change, and store the picture of the facade before."""
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
        told |= {"before_file": path, "before_digest": digest_stored_file(file.getvalue())}
    return told


def _describe_source(imagery: FacadeImagery, depth: int, source: str) -> str:
    """Return the source of a facade in words."""
    if imagery.sources()[depth] != "none":
        return f"from {source}"
    return f"from exemplar {source}" if imagery.exemplar is not None else f"by the {source}"


def _join_errors(errors: Sequence[Exception]) -> Exception:
    """Join the errors of all sources of a facade into one."""
    if len(errors) == 1:
        return errors[0]
    joined = FacadeError("; ".join(map(error_reason, errors)))
    joined.__cause__ = errors[0]
    return joined


def texture_from_pictures(run: Run, plan: Plan, unit: Unit, refused: list[Exception]) -> TexturedFacade | None:
    """Texture a facade from the best of its pictures; None if none shows enough. Errors are appended to `refused`."""
    facade, (imagery, textures, _) = unit.index, unit.arguments
    facades = plan.facades
    chart = int(facades.chart[facade])
    along, width = float(facades.along[facade]), float(facades.width[facade])
    said = imagery.corrected
    *pictures, _ = imagery.sources()
    for depth, source in enumerate(pictures):
        size = working_size(plan, chart, source)
        with collect_input_errors(refused):
            evidence = read_evidence(source, plan, chart, size, imagery, textures, refused, run.models.parser)
            if evidence is not None:
                try:
                    result = build_facade_from_photo(
                        replace(
                            evidence,
                            hidden=evidence.hidden | rasterise_boxes(said.hide, size),
                            facade=rasterise_boxes(said.keep, size),
                        ),
                        doors=MappedDoors(
                            [(place - along) / width for place in imagery.entrances if along < place < along + width],
                            int(facades.role[facade]) == WallRole.STREET,
                        ),
                        models=run.models,
                        seed=unit_seed(run, facades.id[facade], FACADE_SEED),
                    )
                except ImageError as error:
                    raise ImageError(f"{evidence.source}: {error}") from error
                result, confidence = sharpen_from_pictures(plan, chart, result, evidence)
                result = _apply_correction(result, imagery)
                return TexturedFacade(depth, result, evidence.source, confidence, evidence)
    return None


def _texture_from_exemplar(
    run: Run,
    plan: Plan,
    group: StoreGroup,
    unit: Unit,
    wall_colour: Callable[[tuple[int, ...]], Float64Array | None],
    own_style: Callable[[tuple[int, ...]], PicturedStyle | None],
    beside: tuple[int, ...],
) -> TexturedFacade:
    """Texture a facade in the style of its building's best pictured facade, else of its exemplar, or leave it to the street.

    Parameters
    ----------
    wall_colour : returns the colour of the walls of some facades.
    own_style : returns the style of the best pictured one of some facades.
    beside : facades of the building with pictures.
    """
    facade, (imagery, *_) = unit.index, unit.arguments
    facades, placement = plan.facades, plan.scene.placement
    chart = int(facades.chart[facade])
    size = (int(placement.height[chart]), int(placement.width[chart]))
    depth, nothing = len(imagery.sources()) - 1, np.zeros(size, np.uint8)
    own = own_style(beside) if imagery.exemplar is not None and not imagery.is_exemplar_stated else None
    result = build_unit_from_exemplar(run, plan, group, unit, size, wall_colour(beside), own)
    if result is None:
        return TexturedFacade(depth, None, "translator", nothing)
    source = imagery.exemplar[1] if own is None else own.source
    return TexturedFacade(depth, _apply_correction(result, imagery), source, nothing)


def _apply_correction(facade: Facade, imagery: FacadeImagery) -> Facade:
    """Return a facade with the corrected elements."""
    elements = imagery.corrected.elements
    return facade if elements is None else replace_elements(facade, elements)


def _read_shop_names(result: Facade, evidence: Evidence, source: str, texels_per_metre: float) -> str | None:
    """Return the names of shops on a facade's own photo; None without a photo or detectors."""
    if source != "photo" or not detectors_available():
        return None
    seen = evidence.seen
    return "; ".join(shop_names(seen.lines, result.labels, result.occluded, seen.plates, texels_per_metre))


def _write_rasters(
    group: StoreGroup, plan: Plan, facade: int, result: Facade, shown: UInt8Array, confidence: UInt8Array
) -> dict[str, str]:
    """Write a facade's rasters and hierarchy; returns its chart's digest."""
    scene, chart = plan.scene, int(plan.facades.chart[facade])
    rasters = TexelLayout.of_charts(scene.placement, [chart])
    seed = result.image.reshape(-1, 3)
    evidence = result.provenance.reshape(-1)
    arrays: dict[str, AnyArray] = {
        "atlas/seed": seed,
        "atlas/seed_evidence": evidence,
        "facade_maps/labels": result.labels.reshape(-1),
    }
    if result.hierarchy is not None:  # of others there is no more to tell: nothing is kept twice
        arrays |= {
            "facade_maps/evidence": shown.reshape(-1, 3),
            "facade_maps/occluded": result.occluded.reshape(-1),
            "facade_maps/confidence": confidence.reshape(-1),
        }
        path = variation_hierarchy_path(int(plan.ids[chart]))
        write_stored_file(group, path, result.hierarchy.to_bytes(), f"variations of {plan.facades.id[facade]}")
    for name, flat in arrays.items():
        write_rasters(group[name], scene.spec, scene.placement, rasters, flat)
    return chart_digests(seed, evidence, scene.placement, rasters, plan.ids)


def _summarize(result: Facade) -> dict[str, object]:
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
        "elements": [
            [e.label, *(round(v, 1) for v in (e.x0, e.y0, e.x1, e.y1)), round(e.confidence, 3)] for e in result.elements
        ],
        "lattice": {"rows": list(map(int, result.lattice.rows)), "columns": list(map(int, result.lattice.columns))},
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
        "layout_score": None if result.completion is None else round(float(result.completion.score), 4),
        **({"repeated_foot": round(result.repeated_foot_share, 4)} if result.repeated_foot_share else {}),
    } | ({} if result.hierarchy is None else count_variations(result.hierarchy))
