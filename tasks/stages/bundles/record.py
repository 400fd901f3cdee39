"""Records of bundles of panoramas."""

from __future__ import annotations

from typing import TypedDict

from facade_core.atlas.journal import Record


class PoseFieldsFromBundle(TypedDict, total=False):
    """Fields of a panorama's pose record that its bundle replaces."""

    shared: int
    apart_before_m: float | None
    apart_m: float | None
    kept_alone: str
    pose: list[float]
    moved_m: float | None
    turned_deg: float | None
    residual_deg: float | None
    fit: float | None
    over_ground_m: float | None
    squares: list[list[int]]


class BundledPose(TypedDict):
    """Result of a bundle for one panorama.

    Attributes
    ----------
    alone : pose refined alone.
    found : fields of the panorama's own record that the bundle replaces.
    """

    alone: list[float]
    found: PoseFieldsFromBundle


class BundleRecord(Record, total=False):
    """Record of a bundle: panoramas whose poses were refined together.

    Attributes
    ----------
    together : result by name of the panorama.
    """

    together: dict[str, BundledPose]
