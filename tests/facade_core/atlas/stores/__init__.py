"""A store of this format, as it lay in a run's folder when the format was new: it is read as long as the number stays.

`python -m tests.facade_core.atlas.stores` makes that of a new format, once.
"""

from __future__ import annotations

import tarfile
from pathlib import Path

from facade_core.atlas.arrays import STORE_FORMAT

PACKED_STORE = Path(__file__).with_name(f"format-{STORE_FORMAT}.tar.xz")
BUILDINGS = {"a": (4, 5, 12, 2.8, 7.0)}
STREETS = {"1": [(0, 0), (18, 0)]}


def unpack(store: Path, out: Path) -> Path:
    """Lay one of the stores into the folder of a run, which is returned."""
    with tarfile.open(store) as tar:
        tar.extraction_filter = getattr(tarfile, "data_filter", None)  # the first Pythons of 3.11 have none
        tar.extractall(out)
    return out
