"""A facade at a finer raster has the detail of its pictures where it is photographed, and its layout as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.resizing import resize_image
from facade_core.core.types import Element, Lattice
from facade_core.facade.facade import Facade
from facade_core.facade.sharpening import enlarge_classes, enlarge_image, picture_detail, sharpen_facade
from facade_core.facade.variation.encoding import encode

FINE, COARSE, SCALE = (240, 301), (120, 151), 2.0


@pytest.fixture(scope="module")
def painted() -> np.ndarray:
    whole = paint_facade((12.0, 12.0), floors=3, columns=4, style="jugend", metres_per_pixel=1 / 30, seed=2).image
    return whole[: FINE[0], : FINE[1]]


def coarse_facade(image: np.ndarray, light: float = 1.0) -> Facade:
    """The lower half is hidden and grey."""
    hidden = np.arange(COARSE[0])[:, None] >= np.full(COARSE[1], 60)
    shown = np.where(hidden[..., None], 90, light * resize_image(image, COARSE)).astype(np.uint8)
    elements = (Element("window", 20, 10, 151, 120),)
    return Facade(
        evidence=shown,
        image=shown,
        labels=np.where(hidden, FacadeClass.DOOR, FacadeClass.WALL).astype(np.uint8),
        occluded=hidden,
        provenance=np.where(hidden, Provenance.INPAINTED, Provenance.PHOTO).astype(np.uint8),
        masked=((3, 4, 151, 120),),
        masked_share=0.1,
        lattice=Lattice((0, 60, 120), (0, 20, 151)),
        elements=elements,
        hierarchy=encode(shown, elements),
        completion=None,
        estimates=None,
        floors=2,
        seconds={},
    )


def test_photographed_texels_are_the_evidence_beside_what_hides_the_facade(painted: np.ndarray) -> None:
    coarse = coarse_facade(painted)
    coarse = replace(coarse, evidence=np.where(coarse.occluded[..., None], 230, coarse.evidence).astype(np.uint8))
    made = sharpen_facade(
        coarse, picture_detail(painted, np.ones(FINE, bool), resize_image(painted, COARSE), SCALE), SCALE
    )
    photo = made.provenance == Provenance.PHOTO
    np.testing.assert_array_equal(made.image[photo], made.evidence[photo])
    assert made.evidence[~photo].mean() > 220


@pytest.mark.parametrize("light", [1.0, 0.6])
def test_photographed_texels_are_those_of_the_picture_in_the_light_of_the_facade(
    painted: np.ndarray, light: float
) -> None:
    coarse = coarse_facade(painted, light)
    detail = picture_detail(painted, np.ones(FINE, bool), resize_image(painted, COARSE), SCALE)
    made = sharpen_facade(coarse, detail, SCALE)
    wanted = light * painted[:100].astype(float)
    before = enlarge_image(coarse.image, FINE, SCALE)[:100]
    errors = [np.sqrt(((image - wanted) ** 2).mean()) for image in (before, made.image[:100])]
    assert errors[1] < 0.6 * errors[0]
    np.testing.assert_array_equal(made.image, made.evidence)
    np.testing.assert_array_equal(made.image[130:], 90)
    assert made.hierarchy is not None
    assert made.hierarchy.reconstruct(len(made.hierarchy.levels) - 1).shape == (*FINE, 3)


def test_noise_of_a_picture_does_not_grow() -> None:
    noise = np.random.default_rng(5).normal(50, 4, (*FINE, 3))
    picture = np.clip(noise, 0, 255).astype(np.uint8)
    detail = picture_detail(picture, np.ones(FINE, bool), resize_image(picture, COARSE), SCALE)
    made = sharpen_facade(coarse_facade(picture), detail, SCALE)
    shown = (slice(10, 100), slice(10, -10))
    assert np.abs(made.image[shown].astype(int) - picture[shown]).max() <= 1


def test_the_layout_is_scaled_and_stays_within_the_raster(painted: np.ndarray) -> None:
    made = sharpen_facade(coarse_facade(painted), np.ones((*FINE, 3), np.float32), SCALE)
    (window,) = made.elements
    assert (window.x0, window.y0, window.x1, window.y1) == (40, 20, 301, 240)
    assert made.lattice == Lattice((0, 120, 240), (0, 40, 301))
    assert made.masked == ((6, 8, 301, 240),)
    assert {raster.shape[:2] for raster in (made.image, made.labels, made.occluded, made.provenance)} == {FINE}
    assert made.occluded.dtype == bool
    assert (made.occluded == (np.arange(240)[:, None] >= 120)).all()
    assert (made.labels == np.where(made.occluded, FacadeClass.DOOR, FacadeClass.WALL)).all()


def test_there_is_no_detail_beside_what_a_picture_does_not_show(painted: np.ndarray) -> None:
    seen = np.arange(FINE[1]) < np.full((FINE[0], 1), 150)
    shown = np.where(seen[..., None], painted, 0).astype(np.uint8)
    detail = picture_detail(shown, seen, resize_image(shown, COARSE), SCALE)
    assert (detail[:, 144:] == 1).all()
    assert (detail[:, :140] != 1).any()


def test_a_raster_is_enlarged_from_its_corner() -> None:
    columns = np.broadcast_to(10 * np.arange(20, dtype=np.uint8), (4, 20))
    places = (np.arange(39) + 0.5) / 2
    assert (enlarge_classes(columns, (8, 39), 2.0)[0] == 10 * places.astype(int)).all()
    np.testing.assert_allclose(enlarge_image(columns, (8, 39), 2.0)[0, 4:-4], 10 * (places - 0.5)[4:-4], atol=1)
