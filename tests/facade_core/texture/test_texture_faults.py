"""Measures of what is wrong with a finished texture."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.facade.evidence import Evidence
from facade_core.facade.photo_facade import build_facade_from_photo
from facade_core.facade.texture_faults import foreign_share, inpainted_radius, inpainting_doubt
from facade_core.parsing.segmentation import Segmentation


def test_occluders_surroundings_and_sky_are_foreign() -> None:
    confidence = np.zeros((4, 5, 7), np.float32)
    confidence[..., FacadeClass.WALL] = 0.6
    confidence[0, :, FacadeClass.SKY] = 1.0
    occluder, outside = np.zeros((4, 5), np.float32), np.zeros((4, 5), np.float32)
    occluder[:, 0], occluder[:, 1], outside[3, 4] = 0.9, 0.4, 0.7
    assert foreign_share(Segmentation(confidence, occluder, outside)) == pytest.approx((5 + 3 + 1) / 20)


def test_radius_is_that_of_the_largest_hole_and_ends_at_the_wall() -> None:
    inpainted = np.zeros((60, 80), bool)
    assert inpainted_radius(inpainted) == 0
    inpainted[10:31, 20:41] = True
    inpainted[50:, :] = True
    assert inpainted_radius(inpainted) == pytest.approx(11, abs=0.1)


def test_doubt_is_that_of_the_inpainted_part() -> None:
    confidence = np.zeros((2, 3, 7), np.float32)
    confidence[0, :, 1], confidence[1, :, 2] = 1.0, 0.7
    inpainted = np.zeros((2, 3), bool)
    assert inpainting_doubt(confidence, inpainted) == 0
    inpainted[1] = True
    assert inpainting_doubt(confidence, inpainted) == pytest.approx(0.3)


def test_a_facade_has_the_measures_of_its_finished_texture() -> None:
    painted = paint_facade((13.0, 17.0), floors=5, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    hidden = np.zeros(painted.labels.shape, bool)
    whole = build_facade_from_photo(Evidence(image=painted.image, hidden=hidden))
    hidden[100:160, 60:120] = True
    holed = build_facade_from_photo(Evidence(image=painted.image, hidden=hidden, is_clean=True))
    assert whole.foreign_share is not None
    assert whole.foreign_share < 0.02
    assert whole.inpainting_doubt == 0 or whole.occluded.any()
    assert holed.foreign_share == 0, "a clean picture has nothing in front of it"
    assert holed.inpainting_doubt is not None
    assert 0 < holed.inpainting_doubt < 0.5
