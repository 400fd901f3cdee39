"""Photos of a painted wall by known cameras, rectified; and pictures that are refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.photo import Rectified, rectify

HEIGHT, WIDTH = 600, 900
FOCAL = 800.0
WALL = (12.0, 9.0)  # metres


def painted(width: int = 960, height: int = 720) -> np.ndarray:
    """A wall with windows, sills and a frieze: (height, width, 3) uint8 at 80 pixels per metre."""
    wall = np.full((height, width, 3), (190, 170, 140), np.uint8)
    for y in range(60, height - 120, 160):
        cv2.rectangle(wall, (0, y - 30), (width, y - 24), (120, 105, 90), -1)
        for x in range(50, width - 90, 120):
            cv2.rectangle(wall, (x, y), (x + 56, y + 90), (60, 70, 90), -1)
            cv2.rectangle(wall, (x - 6, y + 92), (x + 62, y + 100), (220, 215, 205), -1)
            cv2.line(wall, (x + 28, y), (x + 28, y + 90), (200, 200, 200), 3)
    return wall


def plane_to_photo(yaw: float, pitch: float, roll: float, distance: float = 14.0, focal: float = FOCAL) -> np.ndarray:
    """Homography from metres on the wall, x right and y down from its middle, to photo pixels."""
    turned = Rotation.from_euler("zxy", [roll, pitch, yaw], degrees=True).as_matrix()
    camera = np.array([[focal, 0, (WIDTH - 1) / 2], [0, focal, (HEIGHT - 1) / 2], [0, 0, 1.0]])
    return camera @ np.column_stack([turned[:, 0], turned[:, 1], [0.0, 0.0, distance]])


def photo_of(wall: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """The wall before a sky, seen through a homography as of plane_to_photo, with a little noise."""
    pixels = np.array(
        [[WALL[0] / wall.shape[1], 0, -WALL[0] / 2], [0, WALL[1] / wall.shape[0], -WALL[1] / 2], [0, 0, 1]]
    )
    sky = np.linspace((120, 160, 220), (200, 215, 235), HEIGHT)[:, None].repeat(WIDTH, axis=1).astype(np.uint8)
    cv2.warpPerspective(
        wall, plane @ pixels, (WIDTH, HEIGHT), sky, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT
    )
    return np.clip(sky + np.random.default_rng(3).normal(0, 3, sky.shape), 0, 255).round().astype(np.uint8)


def through(homography: np.ndarray, points) -> np.ndarray:
    moved = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return moved[:, :2] / moved[:, 2:]


def errors(found: Rectified, plane: np.ndarray) -> tuple[float, float]:
    """Degrees by which the wall's axes are off, and how far width over height is off, as a share."""
    whole = found.homography @ plane
    left, right = through(whole, [[-4, y] for y in (-3, 0, 3)]), through(whole, [[4, y] for y in (-3, 0, 3)])
    top, bottom = through(whole, [[x, -3] for x in (-4, 0, 4)]), through(whole, [[x, 3] for x in (-4, 0, 4)])
    across, down = right - left, bottom - top
    angles = np.degrees(np.concatenate([across[:, 1] / across[:, 0], down[:, 0] / down[:, 1]]))
    ratio = across[:, 0].mean() / 8 / (down[:, 1].mean() / 6)
    return float(np.abs(angles).max()), abs(float(ratio) - 1)


CAMERAS = [(0, 0, 0), (30, 0, 0), (-40, 10, 3), (20, 20, -4), (0, -22, 2), (40, -18, 0)]


@pytest.mark.parametrize(("yaw", "pitch", "roll"), CAMERAS)
def test_axes_and_proportion_with_the_focal_length_given(yaw: float, pitch: float, roll: float) -> None:
    plane = plane_to_photo(yaw, pitch, roll)
    found = rectify(photo_of(painted(), plane), focal=FOCAL)
    axis, aspect = errors(found, plane)
    assert axis < 0.3
    assert aspect < 0.02
    assert found.focal == pytest.approx(FOCAL, rel=0.06)


@pytest.mark.parametrize(("focal", "yaw", "pitch"), [(650.0, 30, 20), (1100.0, -35, 18), (800.0, 40, -20)])
def test_the_focal_length_is_found_where_both_vanishing_points_are_near(focal: float, yaw: float, pitch: float) -> None:
    plane = plane_to_photo(yaw, pitch, 0, distance=14.0 * focal / FOCAL, focal=focal)
    found = rectify(photo_of(painted(), plane))
    axis, aspect = errors(found, plane)
    assert axis < 0.3
    assert aspect < 0.03
    assert found.focal == pytest.approx(focal, rel=0.1)


def test_an_undetermined_focal_length_stays_where_it_is_expected() -> None:
    found = rectify(photo_of(painted(), plane_to_photo(0, 0, 0)))
    assert found.focal == pytest.approx(31 / 43.26 * np.hypot(HEIGHT, WIDTH), rel=0.15)


def test_a_cropped_photo_from_the_front_determines_no_focal_length_and_is_rectified() -> None:
    plane = plane_to_photo(2, 34, -3)
    found = rectify(np.ascontiguousarray(photo_of(painted(), plane)[:, :700]))
    assert errors(found, plane)[0] < 3


def test_the_image_is_the_photo_warped_and_black_outside() -> None:
    photo = photo_of(painted(), plane_to_photo(-40, 20, 3, distance=10.0))
    found = rectify(photo)
    height, width = found.image.shape[:2]
    warped = cv2.warpPerspective(photo, found.homography, (width, height))
    assert found.image.dtype == np.uint8
    assert found.seen.shape == (height, width)
    assert (found.image[found.seen] == warped[found.seen]).all()
    assert not found.image[~found.seen].any()
    assert 0 < (~found.seen).mean() < 0.6


def test_the_wall_is_kept_and_most_of_the_sky_is_not() -> None:
    plane = plane_to_photo(35, 12, 2, distance=22.0)
    found = rectify(photo_of(painted(), plane), focal=FOCAL)
    height, width = found.image.shape[:2]
    corners = through(found.homography @ plane, [[-6, -4.5], [6, -4.5], [6, 4.5], [-6, 4.5]])
    slack = 0.02 * max(height, width)
    assert (corners > -slack).all()
    assert (corners < np.array([width, height]) + slack).all()
    assert cv2.contourArea(corners.astype(np.float32)) > 0.7 * width * height


def test_a_rectified_facade_comes_back_whole_and_almost_unchanged() -> None:
    wall = painted()
    found = rectify(wall)
    corners = np.array([[0, 0], [959, 0], [959, 719], [0, 719]])
    assert np.abs(through(found.homography, corners) - corners).max() < 8
    assert np.abs(np.subtract(found.image.shape, wall.shape)).max() < 8


def test_alpha_hides() -> None:
    photo = photo_of(painted(), plane_to_photo(20, 10, 0))
    alpha = np.full((HEIGHT, WIDTH, 1), 255, np.uint8)
    alpha[250:350, 400:500] = 0
    found = rectify(np.concatenate([photo, alpha], axis=2))
    x, y = through(found.homography, [[450, 300]])[0].round().astype(int)
    assert not found.seen[y, x]
    assert not found.image[y, x].any()
    assert found.seen[y, x - 200]


def test_a_large_photo_gives_the_same_facade_at_its_own_resolution() -> None:
    photo = photo_of(painted(), plane_to_photo(-25, 15, 0))
    small, large = rectify(photo), rectify(cv2.resize(photo, (WIDTH * 3, HEIGHT * 3), interpolation=cv2.INTER_CUBIC))
    assert large.image.shape[0] == pytest.approx(3 * small.image.shape[0], rel=0.1)
    assert large.focal == pytest.approx(3 * small.focal, rel=0.1)


def test_the_same_photo_gives_the_same_bits() -> None:
    photo = photo_of(painted(), plane_to_photo(-25, 15, 0))
    one, other = rectify(photo), rectify(photo)
    assert (one.homography == other.homography).all()
    assert (one.image == other.image).all()


def blank() -> np.ndarray:
    return np.full((400, 600, 3), 120, np.uint8)


def noise() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (600, 900, 3), dtype=np.uint8)


def straws() -> np.ndarray:
    """Lines every which way, as in foliage."""
    picture, chance = blank(), np.random.default_rng(1)
    for _ in range(400):
        x, y, angle = chance.uniform(0, 600), chance.uniform(0, 400), chance.uniform(0, np.pi)
        end = (int(x + 60 * np.cos(angle)), int(y + 60 * np.sin(angle)))
        cv2.line(picture, (int(x), int(y)), end, tuple(chance.integers(0, 255, 3).tolist()), 2)
    return picture


def fence() -> np.ndarray:
    """Upright lines only."""
    picture = blank()
    picture[:, ::20] = 30
    picture[:, 1::20] = 30
    return picture


@pytest.mark.parametrize("picture", [blank, noise, straws, fence])
def test_what_shows_no_facade_is_refused_with_a_reason_and_a_remedy(picture) -> None:
    with pytest.raises(ImageError, match=r"^photo: .*; .*leave it out$"):
        rectify(picture())


@pytest.mark.parametrize(
    "image",
    [np.zeros((1, 1, 3), np.uint8), np.zeros((90, 90), np.uint8), np.zeros((90, 90, 3), np.uint16), None],
    ids=["one pixel", "grey", "16 bits", "none"],
)
def test_images_of_another_kind_are_refused(image) -> None:
    with pytest.raises(ImageError):
        rectify(image)


@pytest.mark.parametrize("focal", [0.0, -5.0, float("nan")])
def test_a_focal_length_that_is_none_is_refused(focal: float) -> None:
    with pytest.raises(ImageError, match="focal"):
        rectify(painted(), focal=focal)
