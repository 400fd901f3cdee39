"""Worker of `facades`: texture the facades of one building from pictures or an exemplar, and write the base layer."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from io import BytesIO
from typing import NamedTuple, cast

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record, read_records
from facade_core.atlas.rasters import (
    TexelLayout,
    chart_digests,
    describe_completeness,
    picture_digest,
    write_rasters,
)
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
from tasks.engine.inputs import join_key, note_reads
from tasks.engine.outcome import (
    collect_input_errors,
    error_reason,
    failure_record,
    is_machine_fault,
    rejection_record_fields,
)
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.exemplar_facades import build_wall_from_exemplar
from tasks.stages.facades.exposure import first_picture, level_exposures, measure_pictured_colour
from tasks.stages.facades.imagery import FacadeInputs, iterate_sources
from tasks.stages.facades.photos import describe_crop
from tasks.stages.facades.picture_detail import sharpen_from_pictures, working_size
from tasks.stages.facades.pictured_style import PicturedStyle, select_pictured_style
from tasks.stages.facades.record import FacadeRecord, count_variations
from tasks.stages.facades.wall_colour import photo_wall_colour

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


def process_facades(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Texture the pending facades of one building, which may share chunks; returns the fork and the records.

    If a picture is rejected the next source is taken, and the record names the reason. A facade that cannot be made is recorded
    as failed; the others of the building are written.
    """
    start = time.time()
    plan = load_run_plan(run)
    group = open_root(fork)
    prepared = time.time()
    records: dict[int, Record] = {}
    noted: dict[int, tuple[FacadeInputs, set[str]]] = {unit.index: note_reads(unit.inputs) for unit in units}
    left: list[tuple[Unit[FacadeInputs], list[Exception]]] = []

    def make_and_record(
        unit: Unit[FacadeInputs], make: Callable[[], TexturedFacade | None], refused: list[Exception]
    ) -> bool:
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
            inputs, _ = noted[unit.index]
            about |= rejection_record_fields(refused, _describe_source(inputs, made))
            stages = made.facade.seconds if made.facade is not None else {}
            seconds = {"prepare": prepared - start, "read": time.time() - prepared - sum(stages.values()), **stages}
            about |= _write_facade(group, plan, unit.index, inputs, made, seconds)
            records[unit.index] = Record(unit=unit.name, key="", status="done", **about)  # type: ignore[typeddict-item]
        start = prepared = time.time()
        return True

    for unit in units:
        refused: list[Exception] = []
        make: Callable[[], TexturedFacade | None] = partial(
            texture_from_pictures, unit.index, noted[unit.index][0], refused
        )
        if not make_and_record(unit, make, refused):
            left.append((unit, refused))
    level_exposures(group, plan, records, {unit.index: partial(_exposed_with, noted[unit.index][0]) for unit in units})
    wall_colour = cache(partial(photo_wall_colour, group, plan))

    def source_name(facade: int) -> str:
        known = records.get(facade) or read_records(group, "facades", np.array([facade]))[0]
        return str(cast(FacadeRecord, known).get("source") or "") if known else ""

    own_style = cache(partial(select_pictured_style, group, plan, source_name))
    for unit, refused in left:  # once those with pictures are there: these take their walls' colour
        beside = tuple(f for f in unit.inputs.beside if f not in records or records[f]["status"] == "done")
        make = partial(_texture_from_exemplar, group, unit.index, noted[unit.index][0], wall_colour, own_style, beside)
        make_and_record(unit, make, refused)
    for unit in units:
        record = records[unit.index]
        if record["status"] == "done":
            record["key"] = join_key(unit.digests, noted[unit.index][1])
    return fork, records


def _exposed_with(inputs: FacadeInputs) -> tuple[int, ...]:
    """Return the facades that may share the exposure of a photographed one."""
    return inputs.beside if inputs.exposed_with else ()


def _write_facade(
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
    files: dict[str, str] = {}
    about: dict[str, object] = {"source": made.source, "capture_date": None if shown is None else shown.captured}
    if corrected != AS_FOUND and (result is not None or not corrected.facade):
        about |= {"corrected": True} | ({} if corrected.facade else {"facade": False})
    if result is not None:
        begun = time.time()
        density = float(plan.scene.placement.texels_per_metre[plan.facades.chart[facade]])
        evidence = apply_privacy(result.evidence, result.occluded, inputs.privacy, density)
        digests = _write_rasters(group, plan, facade, result, evidence, made.confidence)
        seconds = seconds | {"write": time.time() - begun}
        about |= _summarize(result) | {"digests": digests, "label_digest": picture_digest(result.labels)}
        if result.hierarchy is not None:
            path = variation_hierarchy_path(int(plan.ids[plan.facades.chart[facade]]))
            files[path] = digest_stored_file(result.hierarchy.to_bytes())
            about |= {"variation_file": path, "variation_digest": files[path]}
        if shown is not None and made.kind in ("photo", "panoramas"):
            names = _read_shop_names(result, shown, made.kind, density)
            about |= {"privacy": inputs.privacy, "looked": detectors_available(), "shop_names": names}
            colour = measure_pictured_colour(result, density)
            about |= {} if colour is None else {"pictured_colour": colour}
            if made.kind == "panoramas" and first_picture(made.source) in {p.name for p in inputs.exposure_factors}:
                about["common_exposure"] = True
        if shown is not None:
            about |= {} if shown.before is None else _write_change(group, plan, facade, shown.before, files)
            about |= describe_crop(shown)
        about |= {"files": files, **describe_completeness([result.provenance])}
    about["seconds"] = {stage: round(s, 4) for stage, s in seconds.items()}
    return about


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


def _describe_source(inputs: FacadeInputs, made: TexturedFacade) -> str:
    """Return the source of a facade in words."""
    if made.kind:
        return f"from {made.source}"
    return f"from exemplar {made.source}" if inputs.exemplar is not None else f"by the {made.source}"


def _join_errors(errors: Sequence[Exception]) -> Exception:
    """Join the errors of all sources of a facade into one."""
    if len(errors) == 1:
        return errors[0]
    joined = FacadeError("; ".join(map(error_reason, errors)))
    joined.__cause__ = errors[0]
    return joined


def texture_from_pictures(facade: int, inputs: FacadeInputs, refused: list[Exception]) -> TexturedFacade | None:
    """Texture a facade from the best of its pictures; None if none shows enough. Errors are appended to `refused`."""
    for kind in iterate_sources(inputs):
        with collect_input_errors(refused):
            if (made := _texture_from_source(facade, inputs, kind, refused)) is not None:
                return made
    return None


def _texture_from_source(
    facade: int, inputs: FacadeInputs, kind: str, refused: list[Exception]
) -> TexturedFacade | None:
    """Texture a facade from one kind of pictures; None if they show too little."""
    if kind == "panoramas":
        plan = inputs.between.plan
    else:
        plan = (inputs.own if kind == "own" and inputs.own is not None else inputs.view).plan
    facades, models = plan.facades, inputs.models
    chart = inputs.view.charts[0]
    size = working_size(plan, chart, kind)
    evidence = read_evidence(kind, plan, chart, size, inputs, inputs.texture_files, refused, models.parser)
    if evidence is None:
        return None
    along, width = float(facades.along[facade]), float(facades.width[facade])
    said = inputs.corrected
    try:
        result = build_facade_from_photo(
            replace(
                evidence,
                hidden=evidence.hidden | rasterise_boxes(said.hide, size),
                facade=rasterise_boxes(said.keep, size),
            ),
            doors=MappedDoors(
                [(place - along) / width for place in inputs.entrances if along < place < along + width],
                int(facades.role[facade]) == WallRole.STREET,
            ),
            models=models,
            seed=inputs.seed,
        )
    except ImageError as error:
        raise ImageError(f"{evidence.source}: {error}") from error
    result, confidence = sharpen_from_pictures(plan, chart, result, evidence)
    return TexturedFacade(kind, _apply_correction(result, inputs), evidence.source, confidence, evidence)


def _texture_from_exemplar(
    group: StoreGroup,
    facade: int,
    inputs: FacadeInputs,
    wall_colour: Callable[[tuple[int, ...]], Float64Array | None],
    own_style: Callable[[tuple[int, ...]], PicturedStyle | None],
    beside: tuple[int, ...],
) -> TexturedFacade:
    """Texture a facade in the style of its building's best pictured facade, else of its exemplar, or leave it to the street.

    Parameters
    ----------
    wall_colour : returns the colour of the walls of some facades.
    own_style : returns the style of the best pictured one of some facades.
    beside : facades of the building with pictures that are written.
    """
    placement, chart = inputs.view.scene.placement, inputs.view.charts[0]
    size = (int(placement.height[chart]), int(placement.width[chart]))
    nothing = np.zeros(size, np.uint8)
    given = inputs.exemplar
    beside = beside if given is not None and inputs.coloured_by else ()
    own = own_style(beside) if given is not None and not inputs.is_exemplar_stated else None
    result = build_wall_from_exemplar(group, facade, inputs, size, wall_colour(beside), own)
    if result is None or given is None:
        return TexturedFacade("", None, "translator", nothing)
    source = given.name if own is None else own.source
    return TexturedFacade("", _apply_correction(result, inputs), source, nothing)


def _apply_correction(facade: Facade, inputs: FacadeInputs) -> Facade:
    """Return a facade with the corrected elements."""
    elements = inputs.corrected.elements
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
