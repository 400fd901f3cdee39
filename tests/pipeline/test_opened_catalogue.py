"""`catalogs.open` on a run that really published."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import catalogs
from facade_core.errors import InputError


def test_search_and_facade(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    catalogue = catalogs.open(undisturbed[0])
    every = catalogue.search()
    assert len(every) == undisturbed[1]["facades_done"]
    some = catalogue.search("photo > 0")
    assert 0 < len(some) < len(every)
    assert some.crs.to_epsg() == 4326
    west, south, east, north = some.total_bounds
    assert set(some["id"]) <= set(catalogue.search(bbox=(west, south, east, north))["id"])

    row = some.iloc[0]
    facade = catalogue.facade(row["id"])
    assert float(facade.x[-1] + facade.x[0]) == pytest.approx(row["width_m"], abs=0.2)
    assert float(facade.y[-1] + facade.y[0]) == pytest.approx(row["height_m"], abs=0.2)
    assert float(facade.occluded.mean()) == pytest.approx(row["occluded"], abs=1e-3)
    assert float((facade.provenance == 4).mean()) == pytest.approx(row["photo"], abs=1e-3)
    assert sum(e[0] == "window" for e in json.loads(facade.attrs["elements"])) == row["windows"]
    seen = ~facade.occluded.values
    assert np.abs(facade.evidence.values[seen].astype(int) - facade.texture.values[seen]).mean() < 1


def test_what_is_not_there(undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no facade nowhere"):
        catalogs.open(undisturbed[0]).facade("nowhere")
    with pytest.raises(InputError, match="nothing is published"):
        catalogs.open(tmp_path)
