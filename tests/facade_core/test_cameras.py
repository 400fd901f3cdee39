"""Ground from panoramas: which squares are believed, one exposure for all cameras, and a painted street got back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.painter.street_paint import ground_pattern_painter
from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.imagery.cameras.agreement import find_ground_lines
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.exposure import estimate_common_exposure, sample_ground_colours, typical_ground_colour
from facade_core.imagery.cameras.ground import fuse_ground_view, select_trusted_ground_texels
from facade_core.imagery.cameras.occluder_masks import mask_ground_occluders
from facade_core.imagery.cameras.settings import GROUND, OCCLUDERS
from facade_core.imagery.panorama_camera import GROUND_REACH_M
from facade_core.imagery.rectify.fusion import ChartView

SIZE = (40, 60)
USUAL = (np.log(np.full(3, 100.0)), np.full(3, 0.05))


def view(colour: float, **boxes: float) -> ChartView:
    """Ground of one colour, with boxes of another: car=30.0 is the right half."""
    rgb = np.full((*SIZE, 3), colour)
    for other in boxes.values():
        rgb[:, SIZE[1] // 2 :] = other
    return ChartView(rgb.astype(np.uint8), np.ones(SIZE, bool), np.full(SIZE, 0.5, np.float32))


def left_of(column: int, colour: float = 100) -> ChartView:
    """Ground of one colour that a camera shows as far as that column."""
    whole = view(colour)
    return replace(whole, seen=whole.seen & (np.arange(SIZE[1]) < column))


def away(metres: float) -> np.ndarray:
    return np.full(SIZE, metres, np.float32)


def test_what_cameras_contradict_each_other_in_is_not_believed() -> None:
    kept = select_trusted_ground_texels([view(100), view(104, car=30.0)], [USUAL, USUAL], 10.0)
    # a square beside the edge of the car is still within what a pose may be off, but for the rim of the one after it
    assert all(one[:, :27].all() and not one[:, 32:].any() for one in kept)


def test_two_that_agree_outvote_a_third() -> None:
    kept = select_trusted_ground_texels([view(100), view(100, car=30.0), view(98)], [USUAL] * 3, 10.0)
    assert kept[0].all()
    assert kept[2].all()
    assert not kept[1][:, 36:].any()


@pytest.mark.parametrize(
    ("colour", "usual", "taken"),
    [
        (100.0, USUAL, True),
        (220.0, USUAL, False),  # a white van
        (100.0, None, False),
    ],
)
def test_one_camera_alone_is_believed_where_all_is_as_usual(
    colour: float, usual: tuple[np.ndarray, np.ndarray] | None, taken: bool
) -> None:
    """To the right of what another camera shows too."""
    kept, _ = select_trusted_ground_texels([view(100, other=colour), left_of(20)], [usual] * 2, 10.0)
    assert kept[:, :17].all()
    assert kept[:, 30:].all() if taken else not kept[:, 30:].any()


@pytest.mark.parametrize(("others", "taken"), [([], True), ([(6, 100)], True), ([(40, 30)], False)])
def test_a_camera_that_others_contradict_is_not_believed_alone(others: list[tuple[int, float]], taken: bool) -> None:
    views = [view(100), *(left_of(*other) for other in others)]
    kept = select_trusted_ground_texels(views, [USUAL] * len(views), 10.0)
    assert kept[0][:, 45:].any() == taken


def test_exposures_come_out_of_shared_squares_but_for_a_common_factor() -> None:
    rng = np.random.default_rng(0)
    truth = rng.uniform(60, 140, (30, 3))
    gains = np.array([[1.0, 1.0, 1.0], [0.8, 0.85, 0.9], [1.2, 1.1, 1.0], [0.5, 0.5, 0.5]])
    seen = []
    for first, gain in zip((0, 8, 16, 200), gains, strict=True):  # the last one shares nothing
        at = range(first, first + 14)
        seen.append([[i, 7, *np.round(truth[i % 30] * gain).astype(int).tolist()] for i in at])
    seen[1][0][2:] = [250, 5, 5]  # a car that only one of them saw
    exposure = estimate_common_exposure(seen)
    left = gains * exposure.factors
    assert np.ptp(np.log(left[:3]), axis=0).max() < 0.06
    assert exposure.factors[3] == pytest.approx([1, 1, 1])
    assert exposure.is_shared.tolist() == [False, True, True, False], "the first shares five squares"
    assert (estimate_common_exposure([]).factors == np.ones((0, 3))).all()


@pytest.fixture(scope="module")
def street() -> SyntheticStreet:
    return synthetic_street(4, seed=3, occluders=1, texels_per_metre=8.0)


def test_a_painted_street_is_got_back_in_one_exposure(street: SyntheticStreet) -> None:
    paint, scene = ground_pattern_painter(street), street.scene
    cameras, squares = [], []
    for along, gain in ((5.0, 0.7), (12.0, 1.0)):
        x, y = street.world_point(along, 0.5)
        pose = Pose(float(x), float(y), 2.5, 40.0)
        image = render_street_panorama(street, pose, 1024, gain=gain, ground=paint)
        ground = sample_ground_colours(scene, image, pose)
        assert ground.height == pytest.approx(2.5, abs=0.01)
        squares.append(ground.squares)
        cameras.append(
            PanoramaCamera(
                image, pose, np.zeros(image.shape[:2], bool), np.ones(3), typical_ground_colour(ground.squares)
            )
        )
    gains = estimate_common_exposure(squares).factors
    assert gains[0] * 0.7 == pytest.approx(gains[1] * 1.0, rel=0.06)
    cameras = [replace(camera, exposure_factor=own) for camera, own in zip(cameras, gains, strict=True)]
    errors, plain = [], []
    for chart in np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist():
        shown = fuse_ground_view(scene, chart, cameras)
        if shown is None:
            continue
        rows, columns = np.nonzero(shown.is_visible)
        step = 1 / scene.placement.texels_per_metre[chart]
        points = scene.charts.points(chart, step * (columns + 0.5), step * (rows + 0.5))
        assert (shown.camera[shown.is_visible] >= 0).all()
        places = np.array([[c.pose.x, c.pose.y] for c in cameras])[shown.camera[rows, columns]]
        off = np.linalg.norm(points[:, :2] - places, axis=1)
        others = np.array([[c.pose.x, c.pose.y] for c in cameras])[1 - shown.camera[rows, columns]]
        # its own vehicle may be there unless the other camera shows the same ground
        near = off < GROUND.min_ground_distance_m - 0.2
        assert (np.linalg.norm(points[near, :2] - others[near], axis=1) < GROUND_REACH_M + 0.2).all()
        assert off.max() < GROUND_REACH_M + 0.2
        assert (shown.camera[~shown.is_visible] == -1).all()
        truth = paint(points[:, :2]) * gains[1]
        errors.append(np.abs(shown.rgb[rows, columns] - truth).mean(axis=1))
        plain.append(np.abs(truth - truth.mean(axis=0)).mean(axis=1))
    assert np.concatenate(errors).size > 10_000
    assert np.median(np.concatenate(errors)) < 0.5 * np.median(np.concatenate(plain))


def test_a_view_of_the_panorama_is_masked_where_the_parser_sees_things(monkeypatch: pytest.MonkeyPatch) -> None:
    """A red car straight ahead, wherever the picture's part of the panorama begins."""
    import facade_core.imagery.cameras.occluder_masks as module

    class Parsing:
        def __init__(self, occluded: np.ndarray) -> None:
            self.occluded = occluded

    monkeypatch.setattr(module, "parse", lambda image: Parsing((image[..., 0] > 150) & (image[..., 1] < 90)))
    image = np.full((360, 720, 3), 110, np.uint8)
    image[200:230, 340:380] = [220, 20, 20]
    mask = mask_ground_occluders(image, Pose(0, 0, 2.5, 0.0))
    assert mask[202:228, 342:378].all()
    assert not mask[: round((90 - OCCLUDERS.ground_top_deg) * 2)].any()
    assert mask.sum() < 2.2 * 30 * 40
    half = mask_ground_occluders(image[90:, 180:540], Pose(0, 0, 2.5, 0.0, view=(0.25, 0.25, 0.5, 0.75)))
    assert (half == mask[90:, 180:540]).mean() > 0.995


def test_what_is_thin_and_shown_by_one_camera_is_not_believed() -> None:
    """A trunk lies elsewhere for each camera; a line on the ground in the same place for both."""
    views = []
    for trunk in (20, 44):
        rgb = np.full((80, 80, 3), 100, np.uint8)
        rgb[:, 60:63] = 200
        rgb[30:74, trunk : trunk + 3] = 45
        views.append(ChartView(rgb, np.ones((80, 80), bool), np.full((80, 80), 0.5, np.float32)))
    kept = select_trusted_ground_texels(views, [USUAL, USUAL], 16.0)
    for one, trunk in zip(kept, (20, 44), strict=True):
        assert not one[34:70, trunk : trunk + 3].any()
        assert one[:, 60:63].all()
        assert one.mean() > 0.7


@pytest.mark.parametrize(
    ("line", "shown_bare", "taken"),
    [
        ("rail", False, True),
        ("post", False, False),  # its foot is at the camera's side, and it points away from the camera
        ("rail", True, False),  # another camera shows the ground without it
    ],
)
def test_a_line_that_does_not_point_at_the_camera_lies_on_the_ground(line: str, shown_bare: bool, taken: bool) -> None:
    size, foot = (96, 160), np.array([20.0, 48.0])
    rgb = np.full((*size, 3), 100, np.uint8)
    strip = (slice(20, 24), slice(30, 130)) if line == "rail" else (slice(46, 50), slice(40, 130))
    rgb[strip] = 210
    shown = np.ones(size, bool)
    views = [ChartView(rgb, shown, np.full(size, 0.5, np.float32))]
    if shown_bare:
        views.append(replace(views[0], rgb=np.full((*size, 3), 100, np.uint8)))
    found = find_ground_lines(views, [foot] * len(views), 16.0)[0]
    assert found[strip][1:-1, 2:-2].all() if taken else not found.any()
    assert found.sum() <= 2 * found[strip].size


def test_of_each_camera_nothing_but_its_view_of_the_ground_is_kept(street: SyntheticStreet) -> None:
    """So that a piece of ground may be taken from many pictures."""
    alive, most = 0, 0

    class Opened(PanoramaCamera):
        def __del__(self) -> None:
            nonlocal alive
            alive -= 1

    def cameras() -> Iterator[PanoramaCamera]:
        nonlocal alive, most
        for along in np.linspace(3.0, 15.0, 6).tolist():
            x, y = street.world_point(along, 0.5)
            image = np.full((128, 256, 3), 120, np.uint8)
            alive += 1
            most = max(most, alive)
            yield Opened(image, Pose(float(x), float(y), 2.5, 40.0), image[..., 0] > 200, np.ones(3), USUAL)

    middle = street.world_point(9.0, 0.0)
    below = np.array([[0.0, 0.0, -1.0]])
    chart = int(street.scene.caster.cast(np.array([*middle, 2.5]), below)[1][0])
    shown = fuse_ground_view(street.scene, chart, cameras())
    assert shown is not None
    assert len(np.unique(shown.camera[shown.is_visible])) > 1
    assert most <= 2, "the one that is viewed, and the next"
