"""When the original of an exemplar may stand for its stored picture."""

from __future__ import annotations

import numpy as np

from facade_core.core.resizing import resize_image
from tasks.export.factored_walls import is_shown_whole


def test_an_original_with_a_small_part_replaced_is_not_used() -> None:
    """A face of 6 texels in a picture of 300 x 400: a fraction of a thousandth."""
    original = np.random.default_rng(0).integers(0, 256, (600, 800, 3)).astype(np.uint8)
    stored = resize_image(original, (300, 400))
    assert is_shown_whole(original, stored)
    stored[100:106, 200:206] = 255 - stored[100:106, 200:206] // 2
    assert not is_shown_whole(original, stored)
