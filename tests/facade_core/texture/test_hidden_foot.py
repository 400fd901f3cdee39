"""Hidden feet of facades: storeys are repeated in step, whole, in the light above; what is seen stays."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.facade.evidence import Evidence
from facade_core.facade.photo_facade import build_facade_from_photo
from facade_core.facade.texture.hidden_foot import find_hidden_foot, repeat_storeys
from tests.facade_core.texture.conftest import FLOOR, draw

# Without a ground floor of its own: seven storeys under 30 rows of roof.
DRAWN = draw(7, street=False)
HEIGHT, WIDTH = DRAWN.labels.shape


def hide(top: int) -> np.ndarray:
    hidden = np.zeros((HEIGHT, WIDTH), bool)
    hidden[top:] = True
    return hidden


@pytest.mark.parametrize("rows", [1.2, 1.75, 2.0, 2.5])
def test_storeys_go_on_in_step_down_to_the_ground(rows: float) -> None:
    hidden = hide(HEIGHT - round(rows * FLOOR))
    spoiled = np.where(hidden[..., None], np.uint8(255), DRAWN.image)
    foot = find_hidden_foot(spoiled, hidden, DRAWN.labels)
    assert foot is not None
    assert foot.top == HEIGHT - round(rows * FLOOR)
    image, missing, labels = repeat_storeys(spoiled, hidden, DRAWN.labels, foot)
    np.testing.assert_array_equal(image[: foot.top], spoiled[: foot.top])
    filled = hidden & ~missing
    assert filled.sum() > 0.9 * hidden.sum()
    whole = np.s_[foot.top : HEIGHT - FLOOR // 2]  # the last storey ends as bare wall
    assert (labels == DRAWN.labels)[whole].mean() > 0.97
    error = np.abs(image[filled].astype(int) - DRAWN.image[filled]).mean()
    assert error < 12, "windows are where they were"


def test_out_of_step_the_last_storey_is_whole() -> None:
    image, labels, top = DRAWN.image.copy(), DRAWN.labels.copy(), HEIGHT - round(1.3 * FLOOR)
    rows = slice(top - round(0.6 * FLOOR), top)  # a bare band that no storey has
    image[rows], labels[rows] = (200, 180, 150), FacadeClass.WALL
    foot = find_hidden_foot(image, hide(top), labels)
    assert foot is not None
    assert foot.start == foot.top == top
    _, _, shown = repeat_storeys(image, hide(top), labels, foot)
    windows = np.flatnonzero((shown[top:] == FacadeClass.WINDOW).any(axis=1))
    assert len(windows) == 20, "as high as they are"
    assert windows[0] > 2
    assert (shown[-3:] == FacadeClass.WALL).all()


def test_the_repeated_storey_is_in_the_light_of_the_one_above() -> None:
    light = np.linspace(1.0, 0.7, HEIGHT)[:, None, None]
    image = np.rint(DRAWN.image * light).astype(np.uint8)
    labels = DRAWN.labels.copy()
    hidden = hide(HEIGHT - 2 * FLOOR)
    hidden[30 + 3 * FLOOR : 30 + 5 * FLOOR, ::6] = True  # the storeys near the foot are not seen whole
    foot = find_hidden_foot(image, hidden, labels)
    assert foot is not None
    assert foot.storey.bottom <= 30 + 3 * FLOOR + 5
    filled, missing, shown = repeat_storeys(image, hidden, labels, foot)
    wall = (shown == FacadeClass.WALL) & ~missing & hidden & (np.arange(HEIGHT)[:, None] >= foot.top)
    source = (labels == FacadeClass.WALL)[foot.storey.top : foot.storey.bottom]
    above = np.median(image[foot.top - FLOOR : foot.top][labels[foot.top - FLOOR : foot.top] == FacadeClass.WALL])
    far = np.median(image[foot.storey.top : foot.storey.bottom][source])
    assert abs(np.median(filled[wall]) - above) < 0.4 * abs(far - above)


def test_a_storey_with_an_entrance_is_not_repeated() -> None:
    """The lowest storey that is seen whole has a narrow, higher pane in place of two windows."""
    image, labels, top = DRAWN.image.copy(), DRAWN.labels.copy(), HEIGHT - round(1.3 * FLOOR)
    entrance = slice(30 + 4 * FLOOR, 30 + 5 * FLOOR)
    image[entrance, : WIDTH // 2], labels[entrance, : WIDTH // 2] = (200, 180, 150), FacadeClass.WALL
    pane = np.s_[entrance.start + 10 : entrance.start + 34, 2:8]
    image[pane], labels[pane] = (60, 80, 110), FacadeClass.WINDOW
    foot = find_hidden_foot(image, hide(top), labels)
    assert foot is not None
    assert foot.storey.bottom <= entrance.start + 5
    _, _, shown = repeat_storeys(image, hide(top), labels, foot)
    whole = np.s_[top : HEIGHT - FLOOR // 2]
    assert (shown == DRAWN.labels)[whole].mean() > 0.95


@pytest.mark.parametrize("why", ["another hue", "loggias in shadow"])
def test_a_repeated_storey_takes_no_tint_and_no_light_from_another_material(why: str) -> None:
    """Above the foot is a bare band; storeys further up have its light."""
    image, labels, top = DRAWN.image.copy(), DRAWN.labels.copy(), HEIGHT - round(1.75 * FLOOR)
    if why == "loggias in shadow":
        image[:, np.arange(WIDTH) % 9 < 5] //= 6
    band = slice(top - round(0.75 * FLOOR), top)
    image[band], labels[band] = (160, 190, 180) if why == "another hue" else (200, 180, 150), FacadeClass.WALL
    foot = find_hidden_foot(image, hide(top), labels)
    assert foot is not None
    filled, _, _ = repeat_storeys(image, hide(top), labels, foot)
    light = filled[foot.top : foot.top + foot.storey.height].mean(axis=(0, 1))
    light /= image[foot.storey.top : foot.storey.bottom].mean(axis=(0, 1))
    np.testing.assert_allclose(light, 1, atol=0.05)


@pytest.mark.parametrize("kind", [FacadeClass.SHOP, FacadeClass.DOOR])
@pytest.mark.parametrize("plinth", [0, 4])
def test_below_shops_and_doors_no_flats_are_repeated(kind: FacadeClass, plinth: int) -> None:
    image, labels, top = DRAWN.image.copy(), DRAWN.labels.copy(), HEIGHT - round(1.5 * FLOOR)
    ground = slice(top - FLOOR, top)
    image[ground], labels[ground] = (200, 180, 150), FacadeClass.WALL
    entrance = np.s_[ground.start + 6 : top - plinth, WIDTH // 4 : WIDTH // 2]
    image[entrance], labels[entrance] = (90, 60, 40), kind
    sign = np.s_[ground.start + 6 : ground.start + 12, WIDTH // 4 : WIDTH // 2]
    image[sign] = (250, 30, 30)
    foot = find_hidden_foot(image, hide(top), labels)
    assert foot is not None
    filled, missing, shown = repeat_storeys(image, hide(top), labels, foot)
    below = hide(top) & ~missing
    assert below.sum() > 0.9 * hide(top).sum()
    assert not (shown[top:] == FacadeClass.WINDOW).any()
    assert (shown[top:] == kind).mean() > 0.15
    assert not (filled[below] == (250, 30, 30)).all(axis=1).any(), "signs are not repeated"


def test_below_windows_in_other_places_no_flats_are_repeated() -> None:
    image, labels, top = DRAWN.image.copy(), DRAWN.labels.copy(), HEIGHT - round(1.5 * FLOOR)
    ground = slice(top - round(1.6 * FLOOR), top)
    image[ground], labels[ground] = (200, 180, 150), FacadeClass.WALL
    pane = np.s_[ground.start + 4 : top - 4, WIDTH // 4 : 3 * WIDTH // 4]
    image[pane], labels[pane] = (60, 80, 110), FacadeClass.WINDOW
    foot = find_hidden_foot(image, hide(top), labels)
    assert foot is not None
    assert foot.ground_floor is not None
    assert ground.start < foot.ground_floor < top


@pytest.mark.parametrize("storeys_above", [0, 1])
def test_below_the_ground_no_flats_are_repeated(storeys_above: int) -> None:
    """The wall of the model reaches two storeys and a half below what is seen of it; street is seen from some row on."""
    top = HEIGHT - round(2.5 * FLOOR)
    outside = np.zeros((HEIGHT, WIDTH), bool)
    ground = top + storeys_above * FLOOR
    outside[ground + 1 :, : WIDTH // 2] = True
    outside[ground - 1 :, WIDTH // 2 : 3 * WIDTH // 4] = True
    foot = find_hidden_foot(DRAWN.image, hide(top), DRAWN.labels, outside)
    assert foot is not None
    assert abs(foot.ground - ground) <= 1
    _, missing, shown = repeat_storeys(DRAWN.image, hide(top), DRAWN.labels, foot)
    assert (shown[top:ground] == FacadeClass.WINDOW).any() == bool(storeys_above)
    assert (shown[ground + 1 :] == FacadeClass.WALL).all()
    assert not missing[ground + 1 + FLOOR // 10 :].any()


def test_neighbours_beside_a_hidden_foot_say_nothing_of_the_ground() -> None:
    """Nothing but a neighbour that stands before a third of the wall, from above the foot down, is outside."""
    top = HEIGHT - round(2.5 * FLOOR)
    outside = np.zeros((HEIGHT, WIDTH), bool)
    outside[top - 2 * FLOOR :, : WIDTH // 3] = True
    foot = find_hidden_foot(DRAWN.image, hide(top), DRAWN.labels, outside)
    assert foot is not None
    assert foot.ground == HEIGHT


def test_leaves_over_the_last_windows_make_no_ground_floor() -> None:
    hidden = hide(HEIGHT - round(1.5 * FLOOR))
    last = HEIGHT - 2 * FLOOR + 10  # the windows above the foot
    hidden[last : last + 4] = True
    foot = find_hidden_foot(DRAWN.image, hidden, DRAWN.labels)
    assert foot is not None
    assert foot.ground_floor is None


def test_columns_that_no_row_shows_say_nothing_of_a_foot() -> None:
    """A third of the facade is seen, and its foot is hidden."""
    hidden = hide(HEIGHT - round(1.75 * FLOOR))
    hidden[:, WIDTH // 2 :] = True
    foot = find_hidden_foot(DRAWN.image, hidden, DRAWN.labels)
    assert foot is not None
    image, missing, _ = repeat_storeys(DRAWN.image, hidden, DRAWN.labels, foot)
    assert missing[:, WIDTH // 2 :].all(), "these are left to inpainting"
    seen = np.s_[foot.top + 3 : HEIGHT - FLOOR // 2, : WIDTH // 2]
    assert not missing[seen].any()
    assert np.abs(image[seen].astype(int) - DRAWN.image[seen]).mean() < 12


@pytest.mark.parametrize("why", ["seen at a third", "too low", "no storey", "nothing hidden"])
def test_other_feet_are_inpainted(why: str) -> None:
    hidden, labels = hide(HEIGHT - round(1.5 * FLOOR)), DRAWN.labels.copy()
    if why == "seen at a third":
        hidden[:, : WIDTH // 3] = False
    elif why == "too low":
        hidden = hide(HEIGHT - round(0.4 * FLOOR))
    elif why == "no storey":
        labels[labels == FacadeClass.WINDOW] = FacadeClass.WALL
    else:
        hidden[:] = False
    assert find_hidden_foot(DRAWN.image, hidden, labels) is None


def test_a_photo_without_its_ground_floor() -> None:
    painted = paint_facade((13.0, 17.0), floors=5, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    height = len(painted.labels)
    hidden = np.zeros(painted.labels.shape, bool)
    hidden[height - 60 :] = True  # 3.6 m
    made = build_facade_from_photo(Evidence(image=painted.image, hidden=hidden, is_clean=True), seed=1)
    assert made.occluded[hidden].all()
    windows = [one for one in made.elements if one.label == "window" and one.y0 >= height - 60]
    assert len(windows) >= 3
    assert all(one.height > 12 for one in windows), "whole ones"
    kept = build_facade_from_photo(
        Evidence(image=painted.image, hidden=hidden, facade=np.ones_like(hidden), is_clean=True), seed=1
    )
    assert (kept.image[-60:] != made.image[-60:]).any(), "somebody says that it shows the facade"
