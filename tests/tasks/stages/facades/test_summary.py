"""What the journal says of a facade, of a photo, of one half hidden, and of an exemplar."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade as paint
from facade_core.facade.evidence import Evidence
from facade_core.facade.exemplar_facade import ScaledStyle, build_facade_from_exemplar
from facade_core.facade.facade import Facade
from facade_core.facade.photo_facade import build_facade_from_photo
from facade_core.facade.texture.retargeting import analyse_exemplar
from facade_core.facade.texture.wall_floors import FacadeWall
from tasks.stages.facades.writing import _summarize

PAINTED = paint((13.0, 14.0), floors=4, columns=4, style="jugend", metres_per_pixel=0.06, seed=2)
HIDDEN = np.zeros(PAINTED.labels.shape, bool)
HIDDEN[:, HIDDEN.shape[1] // 2 :] = True


def of_exemplar() -> Facade:
    size = (270, 334)
    return build_facade_from_exemplar(
        ScaledStyle(analyse_exemplar(PAINTED.image, PAINTED.labels), 0.06),
        FacadeWall.freestanding(16.2, 20.0, floors=5),
        size,
        seed=3,
    )


def test_what_is_seen_is_told_from_what_is_made_up() -> None:
    whole = _summarize(
        build_facade_from_photo(Evidence(image=PAINTED.image, hidden=np.zeros_like(HIDDEN), is_clean=True)), 1 / 0.06
    )
    half = _summarize(build_facade_from_photo(Evidence(image=PAINTED.image, hidden=HIDDEN, is_clean=True)), 1 / 0.06)
    made = _summarize(of_exemplar(), 1 / 0.06)
    assert whole["windows_seen"] == whole["windows"] > 0
    assert 0 < half["windows_seen"] < half["windows"]
    assert made["windows_seen"] == 0 < made["windows"]
    assert [one["floors"] for one in (whole, half, made)] == [4, 4, 5]
    assert whole["windows_high"] - whole["windows_low"] < half["windows_high"] - half["windows_low"]
    assert "windows_low" not in made, "no picture tells"
    assert half["masked_share"] == 0, "nothing stands in front"
    json.dumps([whole, half, made])


def test_shops_are_stretches_and_have_a_width() -> None:
    made = _summarize(of_exemplar(), 1 / 0.06)
    shops = [element for element in made["elements"] if element[0] == "shop"]
    assert made["shops"] == len(shops) > 0
    assert made["shop_width"] == pytest.approx(sum(x1 - x0 for _, x0, _, x1, *_ in shops) / 334, abs=0.02)
    assert 0 < made["shop_width"] < 1
