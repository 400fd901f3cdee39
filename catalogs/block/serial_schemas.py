"""Frozen field names of the values of a block, for digests and part files.

A digest or a part file must not change when an attribute is renamed: on a rename, change only the attribute in a pair.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from catalogs.block.keys import SunSettings, TextureSettings
from catalogs.block.part import CityPart
from catalogs.features import Fault
from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.types import (
    Building,
    BuildingFinish,
    BuildingPassage,
    BuildingShell,
    ElevationRaster,
    GroundArea,
    GroundWay,
    Lens,
    MappedGround,
    Pose,
    Roof,
    Street,
)

# Version of the fields below. Adding, removing or reordering fields changes digests and part files: increment it then,
# unless the fields are added at the end and as `later`.
SCHEMA_VERSION = 1

FieldPairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class SerialSchema:
    """Serialised form of one dataclass.

    Attributes
    ----------
    tag : name of the class in part files.
    fields : pairs of frozen name and attribute, in the order in which they are written.
    omitted : attributes that are not serialised.
    later : attributes of the last fields, added without a new version: left out where they are empty.
    """

    tag: str
    fields: FieldPairs
    omitted: tuple[str, ...] = ()
    later: tuple[str, ...] = ()

    def stated_fields(self, value: object) -> FieldPairs:
        """Return the fields that are serialised of a value."""
        return tuple(
            (name, attribute)
            for name, attribute in self.fields
            if attribute not in self.later or getattr(value, attribute)
        )


def _pairs(names: str, attributes: Mapping[str, str] | None = None) -> FieldPairs:
    """Pair frozen names with attributes; `attributes` holds those whose name in the code differs."""
    return tuple((name, (attributes or {}).get(name, name)) for name in names.split())


def _schema(tag: str, names: str, attributes: Mapping[str, str] | None = None) -> SerialSchema:
    return SerialSchema(tag, _pairs(names, attributes))


SCHEMAS: Mapping[type, SerialSchema] = {
    Orthophoto: _schema("Aerial", "path crs frame content"),
    GroundArea: _schema("Area", "id outline surface"),
    Building: SerialSchema(
        "Building",
        _pairs("id footprint height height_source levels name base roof shell finish raised part_of passages"),
        later=("passages",),
    ),
    BuildingPassage: _schema("Passage", "corridor height"),
    ElevationRaster: _schema("Elevation", "x y step heights"),
    Fault: _schema("Fault", "id kind reason place"),
    BuildingFinish: _schema("Finish", "wall_colour roof_colour wall_material roof_material"),
    MappedGround: _schema("Ground", "ways areas outline"),
    CityPart: _schema(
        "Part",
        "buildings streets beyond fronts shops",
        {"beyond": "distant_buildings", "fronts": "front_streets", "shops": "shop_flags"},
    ),
    Lens: _schema("Lens", "size focal centre radial denominator tangential skew fisheye"),
    Pose: SerialSchema("Pose", _pairs("x y z heading pitch roll view lens"), later=("lens",)),
    PosedPanorama: _schema("PosedPanorama", "id path pose captured"),
    Roof: _schema("Roof", "shape height direction across pitch confidence"),
    BuildingShell: _schema("Shell", "vertices triangles semantic texture uv"),
    Street: _schema("Street", "id name line"),
    SunSettings: _schema("SunSettings", "azimuth elevation"),
    TextureSettings: _schema(
        "TextureSettings",
        "texels_per_metre viewpoint_spacing viewpoint_height visibility_range walls translator panorama_width levelling "
        "roof_material materials sun",
    ),
    GroundWay: _schema("Way", "id line kind width surface assumed lanes oneway pavement parking rank"),
}

# Fields of `Block`, which this module cannot import.
BLOCK_FIELDS = _pairs(
    "name crs buildings streets shops entrances ground terrain exemplars photos photos_rectified privacy panoramas textures "
    "aerial roof_material materials texture storey geoid_separation failed_limit seed notes faults digest corrections part "
    "models style"
)
# Fields of `Block` that the file of a part of a city holds.
PART_FIELDS = tuple(
    pair
    for pair in BLOCK_FIELDS
    if pair[0]
    in (
        "buildings", "streets", "entrances", "ground", "exemplars", "photos", "panoramas", "textures", "aerial", "faults",
        "part",
    )
)  # fmt: skip
