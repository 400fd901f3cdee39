"""The atlas after any viewpoint is opened from Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from facade_core.atlas.journal import read_journal
from facade_core.atlas.store import open_repository
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from tasks.history import after_viewpoint


@pytest.mark.long
def test_texels_come_with_the_viewpoints_and_end_as_they_are_stored(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    out, _ = undisturbed
    group = zarr.open_group(open_repository(out / "store").readonly_session("main").store, mode="r")
    last = max((record for record in read_journal(group, "streets") if record), key=lambda record: record["wave"])
    street = last["unit"]
    first = after_viewpoint(out, street, 0)
    count = len(first.plan.street_viewpoints([one.id for one in first.plan.streets].index(street)))
    end = after_viewpoint(out, street, count - 1)
    assert first.visible_charts() == end.visible_charts()
    known = [int((moment.buffer.provenance > Provenance.UNSEEN).sum()) for moment in (first, end)]
    assert 0 < known[0] < known[1]
    placement = end.plan.scene.placement
    for chart in end.buffer.writable.tolist():
        colour, provenance = end.read_chart(chart)
        y, x = int(placement.y[chart]), int(placement.x[chart])
        at = (int(placement.page[chart]), slice(y, y + colour.shape[0]), slice(x, x + colour.shape[1]))
        translated = provenance == Provenance.TRANSLATED
        np.testing.assert_array_equal(translated, group["atlas/provenance"][at] == Provenance.TRANSLATED)
        np.testing.assert_array_equal(colour[translated], group["atlas/street"][at][translated])


def test_what_there_is_not_is_told(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    out, _ = undisturbed
    group = zarr.open_group(open_repository(out / "store").readonly_session("main").store, mode="r")
    street = next(record for record in read_journal(group, "streets") if record)["unit"]
    with pytest.raises(InputError, match="no street has the id or name 'nowhere'; there are"):
        after_viewpoint(out, "nowhere", 0)
    with pytest.raises(InputError, match="999 is none of 0 to"):
        after_viewpoint(out, street, 999)
    with pytest.raises(InputError, match="does not see chart -5"):
        after_viewpoint(out, street, 0).read_chart(-5)
