"""The ground after any viewpoint is opened from Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from facade_core.atlas.rasters import read_chart_raster
from facade_core.atlas.store import open_repository, open_root
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from tasks.history import StreetState, after_viewpoint


def texels(state: StreetState) -> int:
    """Count the texels that views of a street decided."""
    return sum(int((state.read_chart(chart)[1] == Provenance.TRANSLATED).sum()) for chart in state.visible_charts())


def test_texels_come_with_the_viewpoints_and_end_as_they_are_stored(pictured: Path) -> None:
    """No other street decides what street 3 does; its colours are neither lit nor levelled yet."""
    out = pictured / "out"
    group = open_root(open_repository(out / "store").readonly_session("main"))
    first = after_viewpoint(out, "street 3", 0)
    count = len(first.plan.street_viewpoints([one.id for one in first.plan.streets].index("s3")))
    end = after_viewpoint(out, "s3", count - 1)
    assert first.visible_charts() == end.visible_charts()
    assert len(first.views) == 1 < len(end.views) <= count
    assert 0 < texels(first) < texels(end)
    placement = end.plan.scene.placement
    for chart in end.visible_charts():
        colour, provenance = end.read_chart(chart)
        stored, source, views = (
            read_chart_raster(group, placement, chart, f"atlas/{name}")
            for name in ("colour", "provenance", "street_views")
        )
        translated = provenance == Provenance.TRANSLATED
        translated &= source != Provenance.INPAINTED  # pictures are extended a little
        np.testing.assert_array_equal(translated, source == Provenance.TRANSLATED)
        np.testing.assert_array_equal(translated, views > 0)
        if translated.any():
            unlit, lit = colour[translated].astype(float), stored[translated].astype(float)
            light = lit.mean() / unlit.mean()
            assert 0.7 < light < 1.3
            assert np.abs(light * unlit - lit).mean() < 8


def test_what_there_is_not_is_told(pictured: Path) -> None:
    out = pictured / "out"
    with pytest.raises(InputError, match="no street has the id or name 'nowhere'; there is"):
        after_viewpoint(out, "nowhere", 0)
    with pytest.raises(InputError, match="999 is none of 0 to"):
        after_viewpoint(out, "s1", 999)
    with pytest.raises(InputError, match="does not see chart -5"):
        after_viewpoint(out, "s1", 0).read_chart(-5)
