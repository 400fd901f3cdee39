"""Statistics of a harvested style: of the usable facades, each building once, also those that are no exemplars."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from facade_core.core.json_types import JsonObject
from facade_core.facade.facade_statistics import FacadeStatistics
from tasks.harvest.record import CandidateRecord

# Share of the width from which a ground floor counts as one of shops, and share of a facade as one with balconies.
MIN_SHOP_SHARE = 0.1
MIN_BALCONY_SHARE = 0.01


def summarise_style(records: Sequence[CandidateRecord]) -> JsonObject:
    """Summarise the facades of a style: palette by material, windows, storeys, shops and balconies.

    Heights in metres are none of it: the scale of a picture assumes a height of storeys.
    """
    facades = [FacadeStatistics(**record["statistics"]) for record in records]
    materials = sorted({one.material for one in facades})
    return {
        "facades": len(facades),
        "materials": {
            material: {
                "share": _share(one.material == material for one in facades),
                "colours": sorted(one.wall_colour for one in facades if one.material == material and one.wall_colour),
            }
            for material in materials
        },
        "window_share": _quartiles([one.window_share for one in facades]),
        "floors": _quartiles([record["floors"] for record in records]),
        "ground_storey_ratio": _quartiles(
            [one.ground_storey_ratio for one in facades if one.ground_storey_ratio is not None]
        ),
        "with_shops": _share(one.shop_share >= MIN_SHOP_SHARE for one in facades),
        "with_balconies": _share(one.balcony_share >= MIN_BALCONY_SHARE for one in facades),
    }


def _share(found: Iterable[bool]) -> float | None:
    listed = list(found)
    return round(float(np.mean(listed)), 3) if listed else None


def _quartiles(values: Sequence[float]) -> list[float] | None:
    """First quartile, median and third quartile; None without values."""
    return [round(float(value), 3) for value in np.quantile(values, [0.25, 0.5, 0.75])] if values else None
