"""Facades from panoramas in the common exposure of their cameras."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from facade_core.core.provenance import Provenance
from facade_core.core.types import Pose
from facade_core.imagery.rectify.fusion import ChartView
from tasks.stages.facades import evidence, exposure
from tasks.stages.facades.evidence import MIN_SHOWN_SHARE, read_evidence
from tasks.stages.facades.imagery import FacadeImagery

SIZE = (24, 30)
POSE = Pose(0.0, 0.0, 2.5, 0.0)


@pytest.mark.parametrize(("factors", "light"), [({}, 100), ({Path("one.jpg"): (0.9, 1.0, 1.5)}, (90, 100, 150))])
def test_a_facade_has_the_common_exposure_where_its_panorama_shares_ground(
    monkeypatch: pytest.MonkeyPatch, factors: dict[Path, tuple[float, ...]], light: object
) -> None:
    view = ChartView(np.full((*SIZE, 3), 100, np.uint8), np.ones(SIZE, bool), np.ones(SIZE, np.float32))
    monkeypatch.setattr(evidence, "_view_of_panorama", lambda *_: (view, view.rgb[..., 0]))
    monkeypatch.setattr(evidence, "capture_date", lambda path: None)
    monkeypatch.setattr(evidence, "_reject_other_planes", lambda plan, chart, newest, earlier, _: (newest, earlier))
    monkeypatch.setattr(evidence, "wall_surroundings_mask", lambda *_, **__: None)
    plan: Any = SimpleNamespace(scene=SimpleNamespace(charts=SimpleNamespace(size=np.array([(10.0, 8.0)]))))
    imagery = FacadeImagery(panoramas=((Path("one.jpg"), POSE),), exposure_factors=factors)
    found = read_evidence("panoramas", plan, 0, SIZE, imagery, {}, [])
    assert found is not None
    np.testing.assert_array_equal(found.image, np.broadcast_to(np.array(light, np.uint8), found.image.shape))


@pytest.mark.parametrize(("is_common", "slope"), [(False, 2.0), (True, 1.4)])
def test_walls_in_the_common_exposure_differ_by_sun_and_shade_alone(is_common: bool, slope: float) -> None:
    record: Any = {"unit": "a", "key": "k", "status": "done"} | ({"common_exposure": True} if is_common else {})
    walls = [
        exposure._find_pictured_wall(record | {"pictured_colour": [light] * 3, "source": source})
        for light, source in ((70.0, "one.jpg, two.jpg"), (140.0, "two.jpg"))
    ]
    found = exposure.level_wall_colours(
        [wall.colour for wall in walls if wall], [wall.exposure for wall in walls if wall]
    )
    np.testing.assert_allclose(found[0], slope, atol=0.15)
    np.testing.assert_array_equal(found[1], 1)


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_a_small_part_of_a_wall_does_not_tell_its_material(share: float) -> None:
    provenance = np.full((80, 100), Provenance.INPAINTED, np.uint8)
    provenance[:, : round(share * 100)] = Provenance.PHOTO
    image = np.full((80, 100, 3), 90, np.uint8)
    facade: Any = SimpleNamespace(image=image, labels=np.zeros((80, 100), np.uint8), provenance=provenance)
    colour = exposure.measure_pictured_colour(facade, 10.0)
    assert colour == (None if share < MIN_SHOWN_SHARE else [90.0] * 3)
