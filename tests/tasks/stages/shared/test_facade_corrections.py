"""Corrections of facades whose ids changed, matched by place and width."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from catalogs.block.corrections import Correction, Corrections
from catalogs.crs import LONLAT, coordinate_transform
from facade_core.plan.plan import Plan
from tasks.stages.shared.facade_corrections import map_changed_facade_ids

CRS = "EPSG:3067"
LONGITUDES = 24.94 + 1e-4 * np.arange(200)  # 5.5 m apart


class Facades(SimpleNamespace):
    """Table of facades."""

    def __len__(self) -> int:
        return len(self.id)


def make_plan_of_walls(widths: np.ndarray[Any, np.dtype[np.float64]]) -> Plan:
    """Return a plan of facades at LONGITUDES along a parallel."""
    x, y = coordinate_transform(LONLAT, CRS)(LONGITUDES, np.full(len(LONGITUDES), 60.16))
    feet = np.repeat(np.column_stack([x, y, np.zeros(len(x))])[:, None], 2, axis=1)
    ids = np.array([f"f{i}" for i in range(len(x))], object)
    facades = Facades(id=ids, chart=np.arange(len(x)), width=widths)
    charts = SimpleNamespace(points_at_shares=lambda chart, corners: feet[chart])
    return cast(Plan, SimpleNamespace(facades=facades, scene=SimpleNamespace(charts=charts)))


def create_located_correction(
    id: str, longitude: float, latitude: float = 60.16, width: float | None = 10.0
) -> Correction:
    """Return a correction with a place."""
    return Correction(id, "facade", False, (longitude, latitude), width)


def test_the_nearest_wall_of_that_width_is_taken() -> None:
    widths = np.full(len(LONGITUDES), 10.0)
    widths[3] = 30.0
    said = [
        create_located_correction("moved", LONGITUDES[5] + 1e-5),
        create_located_correction("wide", LONGITUDES[3]),
        create_located_correction("any-width", LONGITUDES[3], width=None),
        create_located_correction("far", LONGITUDES[7], 60.161),
        create_located_correction("nowhere", LONGITUDES[7], 95.0),
        create_located_correction("f1", LONGITUDES[9]),
        Correction("unplaced", "facade", False),
    ]
    found = map_changed_facade_ids(
        make_plan_of_walls(widths), Corrections({one.id: {"facade": one} for one in said}), CRS
    )
    assert found == {"moved": "f5", "any-width": "f3"}


def test_a_hundred_thousand_old_ids_are_matched_in_seconds() -> None:
    old = {f"o{i}": {"facade": create_located_correction(f"o{i}", LONGITUDES[i % 200])} for i in range(100_000)}
    begun = time.process_time()
    found = map_changed_facade_ids(make_plan_of_walls(np.full(200, 10.0)), Corrections(old), CRS)
    assert time.process_time() - begun < 10.0  # 1 second on an idle machine
    assert len(found) == 100_000
    assert found["o99999"] == "f199"
