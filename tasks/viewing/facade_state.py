"""State of a facade for the correction editor: current elements, grid lines and building attributes."""

from __future__ import annotations

from typing import cast

import numpy as np

from catalogs.block.corrections import Corrections
from facade_core.core.json_types import JsonObject
from tasks.stages.facades.record import FacadeRecord
from tasks.viewing.run_view import RunView

# Columns of a building's roof and materials; older stores lack them.
APPEARANCE_COLUMNS = ("roof_shape", "roof_height", "wall_material", "roof_material", "wall_colour", "roof_colour")


def read_facade_state(view: RunView, index: int, corrections: Corrections) -> JsonObject:
    """Return the current state of a facade, corrected or published, as JSON values.

    Targets with a new id keep their corrections.

    Parameters
    ----------
    view : snapshot of the run.
    index : index of the facade.
    corrections : corrections of the block.

    Returns
    -------
    size : [w, h] of its pictures, texels; `texels_per_metre`.
    elements : [[class, left, top, right, bottom]], texels.
    hide, keep : [[left, top, right, bottom]], texels.
    rows, columns : lines of the lattice, texels.
    building : id of the building.
    said : facade flag, levels, height (None for a model), roof, materials, colours and chosen exemplar.
    exemplars : names of available exemplars.
    corrected : corrections in effect, each with author, time and reason.
    """
    tables, corrections = view.tables, corrections.rename_targets(view.id_by_former_id)
    row = int(tables.facades.building[index])
    facade, building = tables.facades.id[index], tables.buildings["id"][row]
    chart = int(tables.facades.chart[index])
    width, height = int(tables.placement.width[chart]), int(tables.placement.height[chart])
    record = view.records[index] or cast(FacadeRecord, {})
    elements = corrections.value_correction(facade, "elements")
    if elements is None:
        current_elements = [list(element[:5]) for element in record.get("elements", [])]
    else:
        current_elements = [
            [label, x0 * width, y0 * height, x1 * width, y1 * height] for label, x0, y0, x1, y1 in elements
        ]
    masks = {
        what: [
            [x0 * width, y0 * height, x1 * width, y1 * height]
            for x0, y0, x1, y1 in corrections.value_correction(facade, what) or ()
        ]
        for what in ("hide", "keep")
    }
    eaves = corrections.value_correction(building, "height") or float(tables.buildings["height"][row])
    appearance = {
        what: corrections.value_correction(building, what) or _to_json_value(tables.buildings[what][row])
        for what in APPEARANCE_COLUMNS
        if what in tables.buildings
    }
    appearance["roof_height"] = (
        None if appearance.get("roof_shape", "") in ("", "flat") else appearance["roof_height"] or None
    )
    lattice = record.get("lattice", {})
    effective = [one for id in (facade, building) for one in corrections.by_target.get(id, {}).values()]
    return {
        "size": [width, height],
        "texels_per_metre": width / float(tables.facades.width[index]),
        "elements": current_elements,
        **masks,
        "rows": list(lattice.get("rows", [0, height])),
        "columns": list(lattice.get("columns", [0, width])),
        "building": building,
        "said": {
            "facade": corrections.value_correction(facade, "facade") is not False,
            "levels": corrections.value_correction(building, "levels") or int(tables.facades.floors[index]),
            "height": None if tables.buildings["height_source"][row] == "model" else round(eaves, 2),
            "exemplar": corrections.value_correction(building, "exemplar") or "",
            **dict.fromkeys(APPEARANCE_COLUMNS, "") | appearance,
        },
        "exemplars": list(view.exemplars),
        "corrected": [
            {"id": one.id, "what": one.kind, "who": one.who, "when": one.when, "why": one.why} for one in effective
        ],
    }


def _to_json_value(value: object) -> float | str:
    return round(float(value), 2) if isinstance(value, float | np.floating) else str(value)
