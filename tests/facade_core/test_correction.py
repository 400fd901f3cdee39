"""Manual corrections of elements: the layout changes, photographed texels stay, synthetic texels follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.types import Element
from facade_core.facade.correction import rasterise_boxes, replace_elements
from facade_core.facade.facade import Facade
from facade_core.parsing.lattice import lattice


def facade(provenance: int) -> Facade:
    """A wall of 60 x 80 texels with three columns and four rows of dark windows."""
    image = np.full((80, 60, 3), 190, np.uint8) + np.random.default_rng(0).integers(0, 9, (80, 60, 1), np.uint8)
    labels = np.full((80, 60), FacadeClass.WALL, np.uint8)
    elements = []
    for y in range(6, 80, 20):
        for x in range(6, 60, 20):
            image[y : y + 10, x : x + 8] = (40, 50, 60)
            labels[y : y + 10, x : x + 8] = FacadeClass.WINDOW
            elements.append(Element("window", x, y, x + 8, y + 10, 0.9))
    return Facade(
        evidence=image, image=image, labels=labels, occluded=np.zeros((80, 60), bool),
        provenance=np.full((80, 60), provenance, np.uint8), masked=(), masked_share=0.0, lattice=lattice(labels),
        elements=tuple(elements), hierarchy=None, completion=None, estimates=None, floors=4, seconds={},
    )  # fmt: skip


def shares(elements: tuple[Element, ...]) -> list[tuple[str, float, float, float, float]]:
    return [(e.label, e.x0 / 60, e.y0 / 80, e.x1 / 60, e.y1 / 80) for e in elements]


def test_a_window_taken_away_is_wall_in_what_was_made_up_and_stays_on_a_photo() -> None:
    for provenance in (Provenance.SYNTHESISED, Provenance.PHOTO):
        before = facade(provenance)
        after = replace_elements(before, shares(before.elements[:4] + before.elements[5:]))
        assert len(after.elements) == 11
        assert (after.labels[26:36, 26:34] == FacadeClass.WALL).all()
        pane = after.image[28:34, 28:32]
        assert (pane.mean() > 150) == (provenance == Provenance.SYNTHESISED)
        kept = np.ones((80, 60), bool)
        kept[22:40, 22:38] = False
        assert np.array_equal(after.image[kept], before.image[kept]), "nothing else is touched"


def test_a_door_is_what_it_is_said_to_be_and_sure() -> None:
    before = facade(Provenance.PHOTO)
    after = replace_elements(before, [*shares(before.elements), ("door", 0.4, 0.9, 0.6, 1.0)])
    assert after.elements[-1] == Element("door", 24, 72, 36, 80)
    assert {e.confidence for e in after.elements} == {1.0}
    assert (after.labels[72:80, 24:36] == FacadeClass.DOOR).all()
    assert np.array_equal(after.image, before.image)


def test_a_window_that_is_new_looks_like_those_there_are() -> None:
    before = facade(Provenance.SYNTHESISED)
    after = replace_elements(before, [*shares(before.elements), ("window", 36 / 60, 46 / 80, 44 / 60, 56 / 80)])
    assert np.array_equal(after.image[46:56, 36:44], before.image[46:56, 26:34])
    assert (after.labels[46:56, 36:44] == FacadeClass.WINDOW).all()


def test_the_same_elements_change_no_texel() -> None:
    before = facade(Provenance.SYNTHESISED)
    after = replace_elements(before, shares(before.elements))
    assert np.array_equal(after.image, before.image)
    assert np.array_equal(after.labels, before.labels)
    assert replace(after, estimates=before.estimates).floors == 4


def test_shares_are_the_texels_whose_middle_they_hold() -> None:
    mask = rasterise_boxes([(0.0, 0.5, 0.25, 1.0), (0.9, 0.0, 1.0, 0.1)], (4, 8))
    assert mask.sum() == 4
    assert mask[2:, :2].all()
