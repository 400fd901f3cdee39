"""Columns of the catalogue table items.parquet: their only declaration.

The table, its rows, the viewer's labels, STAC properties, the metadata of exported models and the reference page
docs/reference/columns.md follow from it. To add a column, add an entry here; if no field of the journal record and no
value of the plan has the value, write a small function in `facade_values`. Then run `python -m tasks.reference`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from catalogs.published.facade_values import (
    QUALITY_CHECKS,
    Fill,
    count_shown_floors,
    largest_pose_value,
    lattice_line_count,
    list_parents,
    list_quality_flags,
    plan_length,
    provenance_share,
    record_field,
    roof_number,
)
from facade_core.core.labels import ELEMENT_PLURALS
from facade_core.core.provenance import Provenance

if TYPE_CHECKING:
    import pyarrow as pa
    from shapely import LineString

    from catalogs.published.facade_values import FacadeSource

# Row before it is written, by ROW_KEYS: the foot line is in the block's frame.
ItemRow = dict[str, Any]

ITEM_KINDS = (
    *("facade", "block", "building", "street", "surface", "panorama", "photo", "exemplar", "page", "tile", "picture"),
)
STATUSES = ("done", "failed", "refused")

TEXT, COUNT, NUMBER = "string", "int32", "double"
SHARE = "0 to 1"


@dataclass(frozen=True, slots=True)
class ItemColumn:
    """Column of the catalogue.

    Attributes
    ----------
    name : name of the column.
    type : type as pyarrow prints it.
    unit : unit of the values, empty without one.
    label : name in the viewer, empty if the viewer does not show the column.
    meaning : description.
    fill : function that returns the value of a facade; None if it follows from the geometry.
    required : whether every row has a value.
    is_common : whether the viewer shows the column before others.
    words : words that the viewer shows for values.
    of_building : how exported models fill the column for buildings: the sum over the facades, or the value that all
        surfaces of the building share; empty otherwise.
    """

    name: str
    type: str
    unit: str
    label: str
    meaning: str
    fill: Fill | None
    required: bool = False
    is_common: bool = False
    words: Mapping[str, str] = field(default_factory=dict)
    of_building: Literal["", "sum", "same"] = ""


def _recorded(name: str, type: str, unit: str, label: str, meaning: str, **settings: Any) -> ItemColumn:
    """Return a column with the values of the equally named field of the journal record."""
    return ItemColumn(name, type, unit, label, meaning, record_field(name), **settings)


def _interval(name: str, type: str, unit: str, label: str) -> tuple[ItemColumn, ItemColumn]:
    """Return the columns of an interval meant to hold the true value in nine of ten facades.

    Measured by `bench elements`: 84 to 100 %.
    """
    text = f"end of the 90 % interval of `{name}`; empty without pictures"
    return (
        _recorded(f"{name}_low", type, unit, f"{label}, at least", f"Lower {text}"),
        _recorded(f"{name}_high", type, unit, f"{label}, at most", f"Upper {text}"),
    )


def _foot_line(source: FacadeSource) -> LineString:
    from shapely import LineString

    return LineString(source.line)


COLUMNS = (
    ItemColumn(
        "id", TEXT, "", "", "ID of the unit, unique within its kind and block", lambda source: source.plan_value("id"),
        required=True,
    ),
    ItemColumn(
        "block", TEXT, "", "", "Name of the block", lambda source: source.block, required=True, of_building="same"
    ),
    ItemColumn(
        "kind", TEXT, "", "",
        "facade, or the kind of a unit that failed, or of an input that was refused, for the given `reason`: "
        f"{', '.join(ITEM_KINDS[1:])}",
        lambda _: "facade", required=True,
    ),
    ItemColumn(
        "building", TEXT, "", "Building", "ID of the building", lambda source: source.building_value("id"),
        of_building="same",
    ),
    ItemColumn(
        "part_of", TEXT, "", "Part of building", "ID of the parent building; empty unless a building part",
        lambda source: source.building_value("part_of") or None, of_building="same",
    ),
    ItemColumn(
        "geometry", "binary", "degrees", "", "Foot line of the facade: WKB LineString in lon/lat (OGC:CRS84)", _foot_line
    ),
    ItemColumn("xmin", NUMBER, "degrees", "", "Western limit of the foot line", None),
    ItemColumn("ymin", NUMBER, "degrees", "", "Southern limit of the foot line", None),
    ItemColumn("xmax", NUMBER, "degrees", "", "Eastern limit of the foot line", None),
    ItemColumn("ymax", NUMBER, "degrees", "", "Northern limit of the foot line", None),
    ItemColumn(
        "street", TEXT, "", "Street",
        "Name of the street that sees the facade, else of the nearest street; its ID if it has no name",
        lambda source: source.street, is_common=True,
    ),
    ItemColumn(
        "role", TEXT, "", "Side of the street",
        "street (visible from a street), side (narrow and visible) or back (not visible)",
        lambda source: source.role, is_common=True,
        words={"street": "at a street", "side": "at the side", "back": "at the back"},
    ),
    ItemColumn(
        "visible", NUMBER, SHARE, "Visible from the street",
        "Share of the facade in sight of its street, by the geometry of the block",
        lambda source: round(float(source.plan_value("seen")), 4), is_common=True,
    ),
    ItemColumn(
        "height_m", NUMBER, "metres", "Height", "Height from the ground to the eaves", plan_length("height"),
        is_common=True,
    ),
    ItemColumn(
        "roof_shape", TEXT, "", "Roof shape",
        "Roof shape of the building, a value of OpenStreetMap's `roof:shape`; empty for a roof from a 3D model",
        lambda source: source.building_value("roof_shape") or None, is_common=True, of_building="same",
    ),
    ItemColumn(
        "roof_height_m", NUMBER, "metres", "Roof height", "Height of the building's roof from eaves to ridge",
        roof_number("roof_height"), of_building="same",
    ),
    ItemColumn(
        "roof_confidence", NUMBER, SHARE, "Roof confidence",
        "Confidence in the roof's shape: 1 if the map states it, less if it is assumed",
        roof_number("roof_confidence"), of_building="same",
    ),
    ItemColumn("width_m", NUMBER, "metres", "Width", "Width along the ground", plan_length("width")),
    ItemColumn(
        "azimuth_deg", NUMBER, "degrees", "Direction", "Direction that the facade faces, clockwise from grid north",
        lambda source: round(source.azimuth_deg, 2),
    ),
    ItemColumn(
        "floors", COUNT, "", "Floors",
        "Storeys that the facade shows, including the ground floor and a row of roof windows; `levels` if it has no windows",
        count_shown_floors, is_common=True,
    ),
    *_interval("floors", COUNT, "", "Floors"),
    ItemColumn(
        "levels", COUNT, "", "Floors by the map",
        "Storeys by the map, including the ground floor: as stated, else height over storey height; limited by the height",
        lambda source: int(source.plan_value("floors")), of_building="same",
    ),
    _recorded("columns", COUNT, "", "Columns of windows", "Columns of windows"),
    _recorded(
        "windows", COUNT, "", "Windows", "Windows of the completed facade", is_common=True, of_building="sum"
    ),
    *_interval("windows", COUNT, "", "Windows"),
    _recorded("doors", COUNT, "", "Doors", "Doors of the completed facade", of_building="sum"),
    _recorded(
        "balconies", COUNT, "", "Balconies", "Balconies of the completed facade", is_common=True, of_building="sum"
    ),
    _recorded(
        "depths_measured", COUNT, "", "Depths measured",
        "Windows, doors and balconies of types whose depth pictures measure; the depths of the rest are assumed by class",
        of_building="sum",
    ),
    _recorded(
        "shops", COUNT, "", "Shops", "Shop fronts of the completed facade; adjoining shops count as one",
        is_common=True, of_building="sum",
    ),
    _recorded("shop_width", NUMBER, SHARE, "Width with shops", "Share of the facade's width that shop fronts take"),
    *(
        _recorded(
            f"{name}_seen", COUNT, "", f"{name.capitalize()} in pictures",
            f"{name.capitalize()} visible in pictures; the rest are inferred", of_building="sum",
        )
        for name in ELEMENT_PLURALS.values()
    ),
    _recorded(
        "window_to_wall", NUMBER, SHARE, "Window-to-wall ratio", "Window area divided by facade area", is_common=True
    ),
    *_interval("window_to_wall", NUMBER, SHARE, "Window-to-wall ratio"),
    _recorded(
        "occluded", NUMBER, SHARE, "Occluded", "Share of the facade that is hidden in its pictures", is_common=True
    ),
    ItemColumn(
        "masked", NUMBER, SHARE, "Inpainted behind objects",
        "Share of the facade hidden by objects in front (trees, cars, people), which were removed and inpainted",
        record_field("masked_share"),
    ),
    _recorded(
        "privacy", TEXT, "", "Objects in front",
        "Treatment of objects in front in the stored pictures: blur, mask or keep; empty without pictures",
    ),
    _recorded(
        "shop_names", TEXT, "", "Shop names", 'Names read above shops, joined by "; "; empty if no photo was read'
    ),
    ItemColumn(
        "corrected", COUNT, "", "Corrected by hand", "1 if the facade or its building was corrected by hand, else 0",
        lambda source: int(bool(source.record.get("corrected")) or source.is_building_corrected),
        is_common=True, words={"0": "no", "1": "yes"},
    ),
    ItemColumn(
        "photo", NUMBER, SHARE, "Covered by pictures", "Share of texels from pictures",
        provenance_share(Provenance.PHOTO), is_common=True,
    ),
    ItemColumn(
        "inpainted", NUMBER, SHARE, "Inpainted", "Share of inpainted texels", provenance_share(Provenance.INPAINTED)
    ),
    ItemColumn(
        "synthesised", NUMBER, SHARE, "From an exemplar", "Share of texels synthesised from an exemplar",
        provenance_share(Provenance.SYNTHESISED),
    ),
    ItemColumn(
        "translated", NUMBER, SHARE, "By the street stage", "Share of texels that the street stage painted",
        provenance_share(Provenance.TRANSLATED),
    ),
    _recorded("source", TEXT, "", "Texture source", "Pictures or exemplars that the texture comes from"),
    _recorded(
        "capture_date", TEXT, "", "Picture date",
        "Capture day of the photo or the newest panorama, from the poses file or EXIF", is_common=True,
    ),
    _recorded(
        "changed", NUMBER, SHARE, "Changed between captures",
        "Share of the compared area that differs from the previous capture; empty with one capture or too little to compare",
        is_common=True,
    ),
    _recorded(
        "compared", NUMBER, SHARE, "Compared between captures",
        "Share of the facade that panoramas of both captures show unobstructed; empty with one capture",
    ),
    _recorded(
        "capture_date_before", TEXT, "", "Previous picture date",
        "Capture day of the newest panorama of the previous capture; empty with one capture",
    ),
    ItemColumn(
        "pose_residual_deg", NUMBER, "degrees", "Pose error by wall lines",
        "Median angle between wall lines and their axes after pose refinement, of the worst panorama used; empty without lines",
        largest_pose_value("residual_deg"),
    ),
    ItemColumn(
        "pose_apart_m", NUMBER, "metres", "Pose error between panoramas",
        "Median distance between panoramas on shared walls after pose refinement, of the worst panorama used; "
        "empty without shared walls",
        largest_pose_value("apart_m"),
    ),
    ItemColumn(
        "pose_raised_m", NUMBER, "metres", "Pose height change",
        "Upward change of a panorama's stated height by pose refinement, of the panorama changed most; empty for photos",
        largest_pose_value("raised_m"),
    ),
    _recorded("variation_types", COUNT, "", "Variation types", "Element types in the variation hierarchy"),
    _recorded("variation_levels", COUNT, "", "Variation levels", "Levels of the variation hierarchy"),
    _recorded("variation_bytes", "int64", "bytes", "Variation size", "Size of the encoded variation hierarchy"),
    ItemColumn(
        "lattice_rows", COUNT, "", "Horizontal lattice lines", "Horizontal lattice lines, including borders",
        lattice_line_count("rows"),
    ),
    ItemColumn(
        "lattice_columns", COUNT, "", "Vertical lattice lines", "Vertical lattice lines, including borders",
        lattice_line_count("columns"),
    ),
    _recorded("layout_score", NUMBER, "", "Layout score", "Score of the completed layout; higher is better"),
    ItemColumn(
        "quality", TEXT, "", "To look at", f"good, or flags to review: {', '.join(QUALITY_CHECKS)}", list_quality_flags,
        is_common=True,
    ),
    ItemColumn(
        "parents", TEXT, "", "",
        "Inputs of the facade: block/, building/ and street/ with their IDs, image/ with file names", list_parents,
    ),
    _recorded(
        "status", TEXT, "", "State", "done, failed (no result) or refused (an input that was set aside)", required=True,
        is_common=True,
    ),
    _recorded("reason", TEXT, "", "", "Why the unit failed, or why pictures of it were rejected"),
    ItemColumn(
        "seconds", NUMBER, "seconds", "Processing time", "Processing time of the facade",
        lambda source: round(sum(source.record.get("seconds", {}).values()), 4),
    ),
    ItemColumn(
        "updated", "timestamp[us, UTC]", "", "Finished", "Time when the unit was finished",
        lambda source: source.updated, required=True,
    ),
    ItemColumn(
        "code_version", TEXT, "", "", "Version of the code that made the block", lambda source: source.code_version,
        required=True, of_building="same",
    ),
    ItemColumn(
        "config_digest", TEXT, "", "", "Digest of inputs and settings", lambda source: source.config_digest,
        required=True,
    ),
)  # fmt: skip
BBOX = tuple(column.name for column in COLUMNS if column.fill is None)
# Keys of a row to be written; the box is computed from the geometry.
ROW_KEYS = tuple(column.name for column in COLUMNS if column.fill is not None)
# Columns that the viewer shows.
SHOWN_COLUMNS = tuple(column for column in COLUMNS if column.label)


def build_item_row(source: FacadeSource) -> ItemRow:
    """Build the row of a facade."""
    return {column.name: column.fill(source) for column in COLUMNS if column.fill is not None}


def arrow_type(column: ItemColumn) -> pa.DataType:
    """Return the Arrow type of a column."""
    import pyarrow as pa

    return pa.timestamp("us", "UTC") if column.type.startswith("timestamp") else pa.type_for_alias(column.type)
