from types import SimpleNamespace
from typing import Any

import numpy as np

from facade_core.core.types import Sun
from facade_core.export.pictures import views
from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.geometry.walls import WallRole


def test_views_are_along_the_streets_with_the_most_facades() -> None:
    facades = SimpleNamespace(
        chart=np.arange(5),
        street=np.array([4, 4, 1, 2, 0]),
        role=np.full(5, WallRole.STREET),
        width=np.array([10.0, 10, 30, 4, 50]),
        height=np.array([12.0, 12, 3, 4, 20]),
    )
    plan: Any = SimpleNamespace(facades=facades, streets=[None] * 5, viewpoint_streets=np.array([1, 1, 2, 3, 4]))
    assert views._view_streets(plan) == [1, 2, 4], "nobody walks along street 0, and street 3 has none"
    assert views.view_names(plan) == ["above", "street-0", "street-1", "street-2", "close-up"]


def test_what_the_sun_is_on_is_worth_more_than_what_is_in_its_own_shade() -> None:
    class Charts:
        def __len__(self) -> int:
            return 3

        def normals(self) -> np.ndarray:
            return np.array([[0.0, -1, 0], [0, 1, 0], [0, 0, 1]])  # of a facade to the south, one to the north, a roof

    facades = SimpleNamespace(chart=np.array([0, 1]), role=np.full(2, WallRole.STREET))
    plan: Any = SimpleNamespace(facades=facades, scene=SimpleNamespace(charts=Charts()))
    assert views._chart_worth(plan, [None, None], None).tolist() == [1, 1, 0]
    assert views._chart_worth(plan, [None, None], Sun(180.0, 40.0)).tolist() == [
        1,
        BLOCK_VIEWS.shaded_worth,
        0,
    ]
    assert views._chart_worth(plan, [None, {"provenance": [0.0, 1.0]}], Sun(180.0, 40.0))[1] > 1, (
        "a photo in the shade still wins"
    )
