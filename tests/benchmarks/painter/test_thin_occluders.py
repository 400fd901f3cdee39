import numpy as np
import pytest

from benchmarks.painter.thin_occluders import THIN_KINDS, ThinView, paint_thin_occluder
from facade_core.core.errors import ImageError
from facade_core.core.labels import UNKNOWN

VIEW = ThinView(1 / 25, 240)
WALL = np.full((240, 320, 3), (200, 170, 140), np.uint8)


def paint(kind: str, seed: int = 0, view: ThinView = VIEW) -> tuple[np.ndarray, np.ndarray]:
    return paint_thin_occluder(WALL, kind, view, np.random.default_rng(seed))


@pytest.mark.parametrize("kind", THIN_KINDS)
def test_the_mask_is_what_was_painted(kind: str) -> None:
    seen = 0
    for seed in range(6):
        image, occluder = paint(kind, seed)
        difference = np.abs(image.astype(np.intp) - WALL).max(2)
        changed = difference > 0
        assert difference[occluder == 0].max(initial=0) < 24, "what is clear looks almost as before"
        assert set(np.unique(occluder)) <= {0, 1, UNKNOWN}
        again, same = paint(kind, seed)
        assert (again == image).all()
        assert (same == occluder).all()
        seen += int((changed & (occluder == 1)).sum() > 0.3 * (occluder == 1).sum() > 0)
    assert seen >= 4, "most places are in the picture"


def test_occluders_have_their_size_in_metres() -> None:
    for kind in ("post", "sign", "signal"):
        coarse, fine = (
            paint_thin_occluder(
                np.full((round(12 * density), round(16 * density), 3), 200, np.uint8),
                kind,
                ThinView(1 / density, 12 * density),
                np.random.default_rng(3),
            )[1]
            for density in (20, 40)
        )
        assert (fine == 1).sum() == pytest.approx(4 * (coarse == 1).sum(), rel=0.35)


def test_gaps_between_bars_are_hidden_too() -> None:
    shares = [(paint("fence", seed)[1] == 1).sum() / max((paint("fence", seed)[1] > 0).sum(), 1) for seed in range(6)]
    assert max(shares) > 0.9


def test_a_foot_outside_the_picture_moves_the_drawing() -> None:
    _, at_foot = paint("sign", 1)
    _, lower = paint("sign", 1, ThinView(1 / 25, 300))
    assert np.flatnonzero((lower == 1).any(1))[0] == pytest.approx(np.flatnonzero((at_foot == 1).any(1))[0] + 60, abs=1)


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ImageError, match="name one of post"):
        paint("pillar")
