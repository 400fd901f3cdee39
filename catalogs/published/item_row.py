"""Row of the catalogue as a typed record; `catalogs.published.items.COLUMNS` describes the columns."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, TypedDict

if TYPE_CHECKING:
    from shapely import LineString


class ItemRow(TypedDict):
    """Row before it is written: the foot line is in the frame of the block, and the columns of its box are absent."""

    id: str
    block: str
    kind: str
    building: str | None
    part_of: str | None
    geometry: LineString | None
    street: str | None
    role: str | None
    height_m: float | None
    roof_shape: str | None
    roof_height_m: float | None
    roof_confidence: float | None
    width_m: float | None
    azimuth_deg: float | None
    floors: int | None
    floors_low: int | None
    floors_high: int | None
    levels: int | None
    columns: int | None
    windows: int | None
    windows_low: int | None
    windows_high: int | None
    doors: int | None
    balconies: int | None
    shops: int | None
    shop_width: float | None
    windows_seen: int | None
    doors_seen: int | None
    balconies_seen: int | None
    shops_seen: int | None
    window_to_wall: float | None
    window_to_wall_low: float | None
    window_to_wall_high: float | None
    occluded: float | None
    masked: float | None
    privacy: str | None
    shop_names: str | None
    corrected: int | None
    photo: float | None
    inpainted: float | None
    synthesised: float | None
    translated: float | None
    source: str | None
    capture_date: str | None
    changed: float | None
    compared: float | None
    capture_date_before: str | None
    pose_residual_deg: float | None
    pose_apart_m: float | None
    pose_raised_m: float | None
    variation_types: int | None
    variation_levels: int | None
    variation_bytes: int | None
    lattice_rows: int | None
    lattice_columns: int | None
    layout_score: float | None
    quality: str | None
    parents: str | None
    status: str
    reason: str | None
    seconds: float | None
    updated: datetime
    code_version: str
    config_digest: str


class ReportRow(ItemRow):
    """Row of a report.

    Attributes
    ----------
    look_first : urgency of a review, the largest first.
    """

    look_first: float
