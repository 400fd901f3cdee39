"""Records of bundles of panoramas."""

from __future__ import annotations

from typing import Any

from facade_core.atlas.journal import Record


class BundleRecord(Record, total=False):
    """Record of panoramas that were refined together.

    Attributes
    ----------
    together : by panorama, its pose refined alone and the fields of its own record that the bundle replaces.
    """

    together: Any
