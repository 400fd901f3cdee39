"""Keys of a block file: the one declaration of their types, ranges, defaults, meanings and roles."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, ConfigDict, Field
from pydantic.fields import FieldInfo

from catalogs.block.declared_keys import Effect, Key, PathKind, Section
from catalogs.readers.vectors.shapefile_text import find_codec
from facade_core.core.types import IngestSettings, Privacy, Sun


def suggest_name(text: str) -> str:
    """Return the text with what a block's name cannot hold replaced by hyphens; empty where nothing is left."""
    return re.sub(r"[^\w.-]+", "-", text).strip("-.")[:MAX_NAME_LENGTH]


# Characters of a block's name.
MAX_NAME_LENGTH = 80


def _check_name(name: str) -> str:
    if not re.fullmatch(rf"\w[\w.-]{{0,{MAX_NAME_LENGTH - 1}}}", name):
        usable = suggest_name(name)
        example = f", such as {usable}" if usable else ""
        raise ValueError(f"use letters, digits, '.', '_' and '-' only, {MAX_NAME_LENGTH} at most{example}")
    return name


def _check_even(value: int) -> int:
    if value % 2:
        raise ValueError("must be even, since the height of a panorama is half its width")
    return value


def _check_area(area: list[float]) -> list[float]:
    west, south, east, north = area
    if not (-180 <= west < east <= 180 and -90 <= south < north <= 90):
        turned = "; west and east, or south and north, are changed about" if west > east or south > north else ""
        unit = ", not in metres" if max(map(abs, area)) > 360 else ""
        raise ValueError(f"must be [west, south, east, north] in degrees of longitude and latitude{unit}{turned}")
    return area


def _check_encoding(name: str) -> str:
    if find_codec(name) is None:
        raise ValueError("is no code page known here; write one such as UTF-8 or windows-1252")
    return name


def _check_date(text: str) -> str:
    try:
        date.fromisoformat(text)
    except ValueError:
        raise ValueError("is no day of the calendar; write one such as 2023-05-01") from None
    return text


def _float_range(low: float, high: float) -> FieldInfo:
    bounds: FieldInfo = Field(strict=True, ge=low, le=high, allow_inf_nan=False)
    return bounds


def _int_range(low: int, high: int) -> FieldInfo:
    bounds: FieldInfo = Field(strict=True, ge=low, le=high)
    return bounds


Text: TypeAlias = Annotated[str, Field(min_length=1)]
Texts: TypeAlias = Annotated[list[str], Field(min_length=1)]
# Code page of the text of Shapefiles.
Encoding: TypeAlias = Annotated[str, Field(min_length=1, max_length=40), AfterValidator(_check_encoding)]
Date: TypeAlias = Annotated[str, AfterValidator(_check_date)]
Offset: TypeAlias = Annotated[list[Annotated[float, _float_range(-1e8, 1e8)]], Field(min_length=3, max_length=3)]
Area: TypeAlias = Annotated[list[float], Field(min_length=4, max_length=4), AfterValidator(_check_area)]

_SOURCE_CRS = Key("Frame of files that state none.", default="the file's own, else `crs`")
_ENCODING = Key(
    "Code page of the text of Shapefiles, e.g. `windows-1252`. Left out: UTF-8 where all of it is valid UTF-8, else as the "
    "`.cpg` or the table states.",
    default="found",
)

_LAYER = Key("Layer of a GeoPackage that has several.", default="that of solids, else by type and name, with a note")


@dataclass(frozen=True, slots=True)
class MaterialPictureSettings:
    """Section `texture.roof_material`."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    path: Annotated[Text, Key("A picture of the material, seen straight on, down the slope.", path=PathKind.FILE)]
    metres_per_pixel: Annotated[
        float, _float_range(0.0001, 1), Key("Its scale.", unit="m", effect=Effect.UNITS, example="0.01")
    ]


@dataclass(frozen=True, slots=True)
class SunSettings(Sun):
    """Section `texture.sun`."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    azimuth: Annotated[
        float,
        _float_range(0, 360),
        Key("Azimuth, clockwise from the north of the block's grid.", unit="°", effect=Effect.UNITS, example="135"),
    ]
    elevation: Annotated[
        float,
        _float_range(5, 90),
        Key("Elevation above the horizon.", unit="°", effect=Effect.UNITS, example="40"),
    ]


@dataclass(frozen=True, slots=True)
class TextureSettings(IngestSettings):
    """Section `texture`."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    texels_per_metre: Annotated[
        float,
        _float_range(1, 100),
        Key(
            "Resolution within 16 m of a street; half of it up to 48 m; a quarter beyond, and on surfaces that face no "
            "street (not below 8).",
            unit="1/m",
            effect=Effect.PLAN,
        ),
    ] = 32.0
    viewpoint_spacing: Annotated[
        float,
        _float_range(0.5, 50),
        Key("Distance between viewpoints along a street.", unit="m", effect=Effect.PLAN),
    ] = 5.0
    viewpoint_height: Annotated[
        float, _float_range(0.5, 20), Key("Height of a viewpoint above the ground.", unit="m", effect=Effect.PLAN)
    ] = 2.5
    visibility_range: Annotated[
        float, _float_range(5, 200), Key("How far a viewpoint sees.", unit="m", effect=Effect.PLAN)
    ] = 40.0
    walls: Annotated[
        Literal["exemplar", "translate"],
        Key("Walls without imagery: from an exemplar, or plain (`translate`).", effect=Effect.PLAN),
    ] = "exemplar"
    panorama_width: Annotated[
        int,
        _int_range(64, 8192),
        AfterValidator(_check_even),
        Key(
            "Width of the panorama in which a viewpoint looks for what it sees; its height is half of it.",
            unit="px",
            effect=Effect.PLAN,
        ),
    ] = 1024
    levelling: Annotated[
        bool,
        Field(strict=True),
        Key(
            "Whether synthesised colours are levelled to adjacent known ones, so that no seam shows.",
            effect=Effect.UNITS,
        ),
    ] = True
    relief: Annotated[
        Literal["off", "elements"],
        Key(
            "Windows, doors, shops and balconies of published models: in depth (`elements`), or flat (`off`).",
            effect=Effect.UNITS,
        ),
    ] = "elements"
    roof_material: Annotated[
        MaterialPictureSettings | None,
        Key("Texture of roofs without imagery; by default material fields of tiles and sheet metal."),
    ] = None
    materials: Annotated[
        Text | None,
        Key(
            "Pictures of materials, one file per name, that replace the shipped grain.",
            path=PathKind.FOLDER,
        ),
    ] = None
    light: Annotated[
        bool,
        Field(strict=True),
        Key(
            "Whether generated colours hold light of the sky, light that surfaces reflect, and `sun`; `false` for programs "
            "that light a scene themselves. Pictures are never lit.",
            effect=Effect.UNITS,
        ),
    ] = True
    sun: Annotated[
        SunSettings | None,
        Key("A soft sun in the textures, with shadows of the block; by default the sky is overcast."),
    ] = None


class HeightsSection(Section):
    """Section `buildings.heights`."""

    path: Annotated[
        Text,
        Key(
            "Raster of the highest points, roofs included (a surface model, such as of LiDAR), in the formats of `terrain`, "
            "which is needed too: the height is the difference. Notes count the buildings that were measured, and those that "
            "the raster does not show or shows no building at.",
            path=PathKind.RASTER,
        ),
    ]


class BuildingsSection(Section):
    """Section `buildings`."""

    path: Annotated[
        Text | Texts,
        Key(
            "Files in any of the [formats](../../catalogs/README.md#formats); if two files state a building, the first "
            "file's is kept. A .pbf also states shops and entrances.",
            path=PathKind.FILE,
        ),
    ]
    crs: Annotated[
        str | None,
        Key(
            "Frame of files that state none (OBJ, GLB, PLY) or a wrong one, with a note.",
            default="the file's own, else `crs`",
        ),
    ] = None
    encoding: Annotated[Encoding | None, _ENCODING] = None
    layer: Annotated[str | None, _LAYER] = None
    offset: Annotated[
        Offset | None,
        Key(
            "`[x, y, z]` added to every coordinate of the buildings: models in a local frame. In `EPSG:2263` x and y are "
            "feet; z is metres in every frame.",
            unit="unit of the buildings' frame for x and y, m for z",
        ),
    ] = None
    lod: Annotated[
        str | None,
        Key(
            'Level of detail to read from CityJSON and CityGML, e.g. `"2"`; the nearest where a building lacks it.',
            default="the highest",
        ),
    ] = None
    up: Annotated[
        Literal["y", "z"] | None,
        Key(
            "Axis of OBJ and PLY files that points up. Without it `z`, unless comments (`# up axis: y`), the names of faces or "
            "the floors of closed models show `y`; a note says so, and where nothing shows the axis.",
            default="by the faces",
        ),
    ] = None
    heights: Annotated[HeightsSection | None, Key("Heights of buildings that state none.")] = None


class StreetsSection(Section):
    """Section `streets`."""

    path: Annotated[
        Text,
        Key(
            "File in any of the [formats](../../catalogs/README.md#formats); may be the buildings' file.",
            path=PathKind.FILE,
        ),
    ]
    crs: Annotated[str | None, _SOURCE_CRS] = None
    encoding: Annotated[Encoding | None, _ENCODING] = None
    layer: Annotated[str | None, _LAYER] = None
    names: Annotated[
        Texts | None, Key("Only streets of these names; the ground keeps all ways of the file.", default="all")
    ] = None


class GroundSection(Section):
    """Section `ground`."""

    path: Annotated[Text | Texts, Key("Vector files (all layers are read), or a .pbf.", path=PathKind.FILE)]
    crs: Annotated[str | None, _SOURCE_CRS] = None
    encoding: Annotated[Encoding | None, _ENCODING] = None


class TerrainSection(Section):
    """Section `terrain`."""

    path: Annotated[
        Text,
        Key(
            "A raster of heights (GeoTIFF, `.asc`, `.img`, JPEG 2000, PNG, DTED, `.hgt`, or a VRT of such files in its "
            "folder), in any CRS it states.",
            path=PathKind.RASTER,
        ),
    ]


class ExemplarsSection(Section):
    """Section `imagery.exemplars`."""

    path: Annotated[
        Text,
        Key(
            "Rectified facade pictures, reduced to at most 2000 pixels a side. A label map NAME.labels.png, one grey value a "
            "class (0 wall, 1 window, 2 balcony, 3 door, 4 roof, 5 shop, 6 sky, 255 unknown), replaces the parser's result "
            "if the picture is fully visible. `streetloom harvest PICTURES --out FOLDER` makes such a folder from unposed "
            "street photos and panoramas.",
            path=PathKind.FOLDER,
        ),
    ]


class StyleSection(Section):
    """Section `imagery.style`."""

    path: Annotated[
        Text,
        Key(
            "Photos as taken and panoramas. Each is harvested once, in local processes, before the other stages, into the "
            "folder `style` of the run. The exemplars are used after those of `imagery.exemplars`, whose names they must "
            "not have. Not in a city file.",
            path=PathKind.FOLDER,
        ),
    ]


class PanoramasSection(Section):
    """Section `imagery.panoramas`."""

    path: Annotated[Text, Key("The panoramas; pictures in folders of it are read too.", path=PathKind.FOLDER)]
    poses: Annotated[
        Text | None,
        Key(
            "Positions and headings in one of the [formats](../../catalogs/README.md#formats); fields that it leaves "
            "open are those of the pictures: GPano XMP, its sidecar, EXIF.",
            default="from the pictures",
            path=PathKind.FILE,
        ),
    ] = None
    since: Annotated[
        Date | None,
        Key(
            "Panoramas captured before this day, such as `2023-05-01`, are left out, with a note; those without a date are "
            "kept.",
            default="all",
        ),
    ] = None


class CamerasSection(Section):
    """Section `imagery.cameras`."""

    path: Annotated[Text, Key("The pictures; those in folders of it, as of rigs, too.", path=PathKind.FOLDER)]
    poses: Annotated[
        Text,
        Key(
            "Their poses and lenses in one of the [formats](../../catalogs/README.md#formats); of COLMAP also the folder of a "
            "model.",
            path=PathKind.FILE_OR_FOLDER,
            example="FILE",
        ),
    ]
    control: Annotated[
        Text | None,
        Key(
            "Control points that place a local frame: a table of `name`, `model_x`, `model_y`, `model_z` (or the name of a "
            "picture), and `x`, `y` (or `lon`, `lat`), `z`.",
            path=PathKind.FILE,
        ),
    ] = None
    crs: Annotated[
        str | None,
        Key("Frame of positions in `poses` and `control`.", default="the file's own, else the block's"),
    ] = None


class AerialSection(Section):
    """Section `imagery.aerial`."""

    path: Annotated[
        Text,
        Key(
            "An orthophoto: GeoTIFF, a mosaic of gdalbuildvrt, or PNG or JPEG with its world file.",
            path=PathKind.RASTER,
        ),
    ]
    crs: Annotated[str | None, Key("Frame of a file that states none or a wrong one.", default="the file's own")] = None


class PhotosSection(Section):
    """Section `imagery.photos`."""

    path: Annotated[Text, Key("A picture's name without suffix is the id of its facade.", path=PathKind.FOLDER)]
    rectified: Annotated[
        bool,
        Key(
            "false: photos as taken from the street; the facade is detected and rectified in each.",
            effect=Effect.UNITS,
        ),
    ] = True


class ImagerySection(Section):
    """Section `imagery`."""

    exemplars: Annotated[
        ExemplarsSection | None,
        Key(
            "Style library for walls without imagery; needed while `texture.walls` is `exemplar`, unless `imagery.style` is "
            "given."
        ),
    ] = None
    style: Annotated[
        StyleSection | None, Key("Street pictures without poses from which the run harvests exemplars.")
    ] = None
    photos: Annotated[PhotosSection | None, Key("Photos of single facades.")] = None
    panoramas: Annotated[PanoramasSection | None, Key("Posed equirectangular street panoramas.")] = None
    cameras: Annotated[
        CamerasSection | None, Key("Perspective pictures with poses, of the street or oblique from the air.")
    ] = None
    aerial: Annotated[
        AerialSection | None, Key("Orthophoto: texture of roofs, and of open ground that no panorama shows.")
    ] = None
    privacy: Annotated[
        Privacy,
        Key(
            "Treatment of people, vehicles and other occluders, and of faces and number plates if their detectors are "
            "installed (`make detect-setup`), in the pictures that a run stores as evidence: means over half a metre, one "
            "colour, or unchanged. Textures never contain them.",
            effect=Effect.UNITS,
        ),
    ] = "blur"


class ModelsSection(Section):
    """Section `models`."""

    parser: Annotated[
        Text | None,
        Key("An .onnx with its .json in the same folder: parser of pictures and exemplars.", path=PathKind.FILE),
    ] = None
    layout: Annotated[Text | None, Key("A .json: completion of partly hidden facades.", path=PathKind.FILE)] = None
    segmentation: Annotated[
        Text | None,
        Key(
            "An .onnx of semantic segmentation with the classes of Cityscapes, ADE20K or Mapillary Vistas: finds occluders "
            "in place of the parser ([how](../networks.md)).",
            path=PathKind.FILE,
        ),
    ] = None
    inpainting: Annotated[
        Text | None,
        Key("An .onnx of LaMa: fills hidden parts, in place of repetitions of the facade.", path=PathKind.FILE),
    ] = None


class PartSection(Section):
    """Section `part`."""

    path: Annotated[
        Text,
        Key(
            "Extract of the city, read instead of the city's files: its own buildings and street segments, which are "
            "textured; its halo, which is seen but not textured; and distant buildings whose exemplar is chosen before one "
            "of its own.",
            path=PathKind.FILE,
        ),
    ]
    city: Annotated[
        Text | None,
        Key("The city file; corrections are kept next to it; the file may be absent."),
    ] = None


class BlockFileSettings(Section):
    """Validated content of a block file, before any file that it names is opened."""

    name: Annotated[
        str,
        AfterValidator(_check_name),
        Key("Name of the block: letters, digits, `.`, `_`, `-`.", effect=Effect.UNITS, example="my-block"),
    ]
    crs: Annotated[
        str | None,
        Key(
            "Projected frame in metres, e.g. `EPSG:3879`; refused where its metre is off by over 1 % there (Web Mercator), or "
            "where its axes are not east and north (Krovak `EPSG:5513`: name `EPSG:5514`).",
            default="the buildings' own, or UTM",
        ),
    ] = None
    area: Annotated[
        Area | None,
        Key(
            "`[west, south, east, north]`: buildings whose representative point is inside; streets are clipped.",
            unit="degrees",
            default="everything",
        ),
    ] = None
    buildings: Annotated[BuildingsSection, Key("The building geometry.", example="{path: FILE}")]
    streets: Annotated[
        StreetsSection | None,
        Key(
            "The street centrelines; left out, they are derived from the gaps between the buildings.", default="derived"
        ),
    ] = None
    ground: Annotated[
        GroundSection | None,
        Key("Ground in addition to what `streets.path` states: areas, paths, crossings."),
    ] = None
    terrain: Annotated[
        TerrainSection | None,
        Key("Heights of the ground; left out, interpolated from the buildings' bases.", default="from the buildings"),
    ] = None
    imagery: Annotated[ImagerySection, Key("Pictures of the block.")] = ImagerySection()
    texture: Annotated[TextureSettings, Key("How the block is textured.")] = TextureSettings()
    models: Annotated[
        ModelsSection,
        Key(
            "Trained models that replace the shipped ones, such as those of `streetloom train parser --corrections` and "
            "`train layout --corrections`, and networks that a user fetches."
        ),
    ] = ModelsSection()
    storey: Annotated[
        float,
        _float_range(2, 8),
        Key("Height of a storey where only storeys are known.", unit="m", effect=Effect.PLAN),
    ] = 3.2
    props: Annotated[
        Literal["off", "stated", "plausible"],
        Key(
            "What stands around: trees, hedges, fences, lamps, tram wires and other objects that the map states, and, where "
            "`area` is given, plain buildings and ground to 150 m from it (`stated`); besides, lamps along lit streets without "
            "any and cars where parking along the kerb is stated (`plausible`, marked in models and counted apart); or nothing "
            "(`off`).",
            effect=Effect.PLAN,
        ),
    ] = "stated"
    geoid_separation: Annotated[
        Annotated[float, _float_range(-120, 120)] | Literal["auto"] | None,
        Key(
            "Height of the geoid above the ellipsoid, for outputs with ellipsoidal heights. `auto`: by EGM96 in the middle of "
            "the block or city, to about 1 m, with a note. Absent: `auto` where the CRS of the buildings has heights above the "
            "sea, as EPSG:7415, else heights as given.",
            unit="m",
        ),
    ] = None
    failed_limit: Annotated[
        float,
        _float_range(0, 1),
        Key(
            "Share of the units (a street counts as one) that may fail before the result is not made current.",
            effect=Effect.NOTHING,
        ),
    ] = 0.2
    part: Annotated[PartSection | None, Key("Part of a city, written by `streetloom city`.")] = None
    seed: Annotated[int, _int_range(0, 2**32 - 1), Key("Start of every random choice.", effect=Effect.UNITS)] = 0
