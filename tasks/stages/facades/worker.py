"""Worker of `facades`: texture the facades of one building from pictures or an exemplar, and write the base layer."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import cast

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record, read_records
from facade_core.atlas.store import open_root
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import FacadeError, HiddenFacadeError, ImageError
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.correction import rasterise_boxes, replace_elements
from facade_core.facade.facade import Facade
from facade_core.facade.photo_facade import MappedDoors, build_facade_from_photo
from facade_core.geometry.walls import WallRole
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
from tasks.stages.facades.element_depths import measure_depths
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.exemplar_facades import build_wall_from_exemplar
from tasks.stages.facades.exposure import level_exposures
from tasks.stages.facades.imagery import FacadeInputs, iterate_sources
from tasks.stages.facades.picture_detail import sharpen_from_pictures, working_size
from tasks.stages.facades.pictured_style import PicturedStyle, select_pictured_style
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.facades.wall_colour import photo_wall_colour
from tasks.stages.facades.writing import TexturedFacade, write_facade


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
            about |= write_facade(group, plan, unit.index, inputs, made, seconds)
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
    evidence = read_evidence(kind, plan, chart, size, inputs, inputs.texture_files, refused, models)
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
        if kind == "panoramas" and isinstance(error, HiddenFacadeError):  # nobody took it of this facade
            return None
        raise ImageError(f"{evidence.source}: {error}") from error
    result, confidence = sharpen_from_pictures(plan, chart, result, evidence)
    result = measure_depths(plan, chart, _apply_correction(result, inputs), evidence)
    return TexturedFacade(kind, result, evidence.source, confidence, evidence)


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
    size = placement.shape(chart)
    nothing = np.zeros(size, np.uint8)
    given = inputs.exemplar
    beside = beside if given is not None and inputs.coloured_by else ()
    own = own_style(beside) if given is not None and not inputs.is_exemplar_stated else None
    result = build_wall_from_exemplar(group, facade, inputs, size, wall_colour(beside), own)
    if result is None or given is None:
        return TexturedFacade("", None, "translator", nothing)
    source = given.names if own is None else own.source
    return TexturedFacade("", _apply_correction(result, inputs), source, nothing)


def _apply_correction(facade: Facade, inputs: FacadeInputs) -> Facade:
    """Return a facade with the corrected elements."""
    elements = inputs.corrected.elements
    return facade if elements is None else replace_elements(facade, elements)
