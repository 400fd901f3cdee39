"""Fusion of views that are written down here: what is chosen, where the seams run, how exposures meet."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.fusion import ChartView, fuse_views

SHAPE = (120, 200)


def wall() -> np.ndarray:
    """A textured wall (h, w, 3) float64."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    return np.stack([120 + 50 * np.sin(x / 9), 120 + 50 * np.cos(y / 7), 110 + 40 * np.sin((x + y) / 13)], axis=-1)


def view(rgb: np.ndarray | None = None, *, quality: float | np.ndarray = 0.5, seen=None, occluded=None) -> ChartView:
    seen = np.ones(SHAPE, bool) if seen is None else seen
    rgb = np.round(np.clip(wall() if rgb is None else rgb, 0, 255)).astype(np.uint8) * seen[..., None]
    return ChartView(rgb, seen, np.broadcast_to(np.float32(quality), SHAPE), occluded)


def box(top: int, bottom: int, left: int, right: int) -> np.ndarray:
    mask = np.zeros(SHAPE, bool)
    mask[top:bottom, left:right] = True
    return mask


def test_the_better_view_wins_and_gives_its_confidence() -> None:
    rising = np.linspace(0, 1, SHAPE[1], dtype=np.float32)[None]
    fused = fuse_views([view(quality=rising), view(quality=1 - rising)])
    assert (fused.source[:, :70] == 1).all()
    assert (fused.source[:, 130:] == 0).all()
    assert fused.confidence[:, [0, -1]].min() > 0.99
    assert fused.confidence.min() > 0.3
    assert np.abs(fused.rgb - wall()).max() <= 1
    assert fused.seen.all()
    assert not fused.occluded.any()


def test_exposures_are_matched_through_a_chain_of_overlaps() -> None:
    columns = np.arange(SHAPE[1])[None].repeat(SHAPE[0], 0)
    parts = [columns < 90, (columns >= 60) & (columns < 150), columns >= 120]
    factors = [np.array([1.0, 1.0, 1.0]), np.array([0.7, 0.75, 0.8]), np.array([0.6, 0.55, 0.6])]
    views = [view(wall() * f, seen=p, quality=q) for f, p, q in zip(factors, parts, (0.9, 0.5, 0.5), strict=True)]
    fused = fuse_views(views)
    assert np.abs(fused.rgb - wall()).max() <= 4
    assert set(np.unique(fused.source)) == {0, 1, 2}


def test_views_without_overlap_keep_their_colours() -> None:
    left = box(0, 120, 0, 100)
    fused = fuse_views([view(wall() * 0.5, seen=left), view(seen=~left)])
    assert np.abs(fused.rgb[:, :90] - wall()[:, :90] * 0.5).max() <= 1
    assert np.abs(fused.rgb[:, 110:] - wall()[:, 110:]).max() <= 1


def test_an_occluded_part_is_taken_from_a_worse_view_that_is_clear() -> None:
    tree, car = box(20, 90, 40, 90), box(80, 120, 60, 160)
    green = np.where(tree[..., None], [40, 90, 30], wall())
    fused = fuse_views([view(green, quality=0.9, occluded=tree), view(quality=0.3, occluded=car)])
    assert (fused.occluded == (tree & car)).all()
    clear = tree & ~car
    assert (fused.source[clear] == 1).all()
    inner = box(30, 75, 50, 80)
    assert np.abs(fused.rgb[inner] - wall()[inner]).max() <= 2
    assert (fused.confidence[tree & car] == 0).all()
    assert (fused.confidence[clear] == np.float32(0.3)).all()


def test_what_one_of_three_views_alone_shows_is_left_out() -> None:
    pole = np.where(box(0, 120, 90, 110)[..., None], [250, 20, 20], wall())
    fused = fuse_views([view(pole, quality=0.6), view(quality=0.5), view(quality=0.5)])
    assert np.abs(fused.rgb - wall()).max() < 12


def test_a_seam_runs_where_the_views_agree() -> None:
    """The views differ everywhere but in a band that is not where their quality is equal."""
    rising = np.linspace(0.45, 0.55, SHAPE[1], dtype=np.float32)[None]
    other = wall() + np.random.default_rng(0).choice([-60.0, 60.0], (12, 20)).repeat(10, 0).repeat(10, 1)[..., None]
    other[:, 130:150] = wall()[:, 130:150]
    fused = fuse_views([view(quality=rising), view(other, quality=1 - rising)])
    change = fused.source[:, :-1] != fused.source[:, 1:]
    assert change.any()
    assert (np.flatnonzero(change.any(axis=0)) >= 126).all()
    assert (np.flatnonzero(change.any(axis=0)) <= 153).all()


def test_unseen_texels_stay_black_and_without_a_source() -> None:
    hole = box(10, 30, 10, 30)
    one = view(seen=~hole)
    for views in ([one], [one, view(seen=~hole & ~box(0, 120, 150, 200))]):
        fused = fuse_views(views)
        assert (fused.seen == ~hole).all()
        assert (fused.source[hole] == -1).all()
        assert not fused.rgb[hole].any()
        assert not fused.confidence[hole].any()
        assert (fused.source[~hole] >= 0).all()


def test_a_view_that_shows_nothing_changes_nothing() -> None:
    alone, both = fuse_views([view()]), fuse_views([view(), view(seen=np.zeros(SHAPE, bool))])
    assert (alone.rgb == both.rgb).all()
    assert (both.source == 0).all()


def test_the_same_views_give_the_same_bits() -> None:
    rng = np.random.default_rng(3)
    views = [view(wall() + rng.normal(0, 20, (*SHAPE, 3)), quality=rng.random(SHAPE)) for _ in range(3)]
    one, two = fuse_views(views), fuse_views(views)
    assert (one.rgb == two.rgb).all()
    assert (one.source == two.source).all()


def test_views_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ImageError, match="give 1 to 127"):
        fuse_views([])
    small = ChartView(np.zeros((4, 4, 3), np.uint8), np.ones((4, 4), bool), np.ones((4, 4), np.float32))
    with pytest.raises(ImageError, match="differ in size"):
        fuse_views([view(), small])
    with pytest.raises(ImageError, match="occluded"):
        view(occluded=np.zeros((4, 4), bool))
    with pytest.raises(ImageError, match="uint8"):
        ChartView(np.zeros((4, 4, 3)), np.ones((4, 4), bool), np.ones((4, 4), np.float32))
