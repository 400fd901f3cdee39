"""Keys of a block file: types, defaults and ranges, and one line for each way to get them wrong."""

from __future__ import annotations

import difflib
import re
import types
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias, Union, get_args, get_origin, get_type_hints

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from catalogs.printable_text import short_repr
from catalogs.readers.vectors.shapefile_text import find_codec
from facade_core.core.types import Privacy, Sun

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


def suggest_name(text: str) -> str:
    """Return the text with what a block's name cannot hold replaced by hyphens; empty where nothing is left."""
    return re.sub(r"[^\w.-]+", "-", text).strip("-.")[:MAX_NAME_LENGTH]


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


def _float_range(low: float, high: float) -> FieldInfo:
    bounds: FieldInfo = Field(strict=True, ge=low, le=high, allow_inf_nan=False)
    return bounds


def _int_range(low: int, high: int) -> FieldInfo:
    bounds: FieldInfo = Field(strict=True, ge=low, le=high)
    return bounds


@dataclass(frozen=True, slots=True)
class MaterialPictureSettings:
    """File of a material's picture, seen straight on, and its metres per pixel."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    path: Annotated[str, Field(min_length=1)]
    metres_per_pixel: Annotated[float, _float_range(0.0001, 1)]


@dataclass(frozen=True, slots=True)
class SunSettings(Sun):
    """Position of the sun within the ranges that a block file may state."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    azimuth: Annotated[float, _float_range(0, 360)]
    elevation: Annotated[float, _float_range(5, 90)]


@dataclass(frozen=True, slots=True)
class TextureSettings:
    """Texture settings of a block: lengths in metres, panorama_width in pixels.

    The README documents each key.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    texels_per_metre: Annotated[float, _float_range(1, 100)] = 32.0
    viewpoint_spacing: Annotated[float, _float_range(0.5, 50)] = 5.0
    viewpoint_height: Annotated[float, _float_range(0.5, 20)] = 2.5
    visibility_range: Annotated[float, _float_range(5, 200)] = 40.0
    walls: Literal["exemplar", "translate"] = "exemplar"
    translator: Literal["exemplar", "neural"] = "exemplar"
    panorama_width: Annotated[int, _int_range(64, 8192), AfterValidator(_check_even)] = 1024
    levelling: Annotated[bool, Field(strict=True)] = True
    roof_material: MaterialPictureSettings | None = None
    materials: Annotated[str, Field(min_length=1)] | None = None
    sun: SunSettings | None = None


def _check_encoding(name: str) -> str:
    if find_codec(name) is None:
        raise ValueError("is no code page known here; write one such as UTF-8 or windows-1252")
    return name


# Code page of the text of Shapefiles.
Encoding: TypeAlias = Annotated[str, Field(min_length=1, max_length=40), AfterValidator(_check_encoding)]


class _Keys(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class PathSection(_Keys):
    """Section of a block file that holds only a path."""

    path: Annotated[str, Field(min_length=1)]


class PartSection(PathSection):
    """Section `part`: the file of a part of a city, and the city's file."""

    city: Annotated[str, Field(min_length=1)] | None = None


class BuildingsSection(_Keys):
    """Section `buildings`: files, CRS, code page, offset, level of detail, upward axis and raster of heights."""

    path: Annotated[str, Field(min_length=1)] | Annotated[list[str], Field(min_length=1)]
    crs: str | None = None
    encoding: Encoding | None = None
    offset: Annotated[list[Annotated[float, _float_range(-1e8, 1e8)]], Field(min_length=3, max_length=3)] | None = None
    lod: str | None = None
    up: Literal["y", "z"] | None = None
    heights: PathSection | None = None


class StreetsSection(_Keys):
    """Section `streets`: file, CRS, code page and names of the streets to keep."""

    path: Annotated[str, Field(min_length=1)]
    crs: str | None = None
    encoding: Encoding | None = None
    names: Annotated[list[str], Field(min_length=1)] | None = None


class GroundSection(_Keys):
    """Section `ground`: files of ground features, their CRS and code page."""

    path: Annotated[str, Field(min_length=1)] | Annotated[list[str], Field(min_length=1)]
    crs: str | None = None
    encoding: Encoding | None = None


class PanoramasSection(_Keys):
    """Section `imagery.panoramas`: folder and poses file."""

    path: Annotated[str, Field(min_length=1)]
    poses: str | None = None


class CamerasSection(_Keys):
    """Section `imagery.cameras`: folder, file of poses and lenses, its CRS, and control points of a local frame."""

    path: Annotated[str, Field(min_length=1)]
    poses: Annotated[str, Field(min_length=1)]
    control: Annotated[str, Field(min_length=1)] | None = None
    crs: str | None = None


class AerialSection(_Keys):
    """Section `imagery.aerial`: orthophoto and its CRS."""

    path: Annotated[str, Field(min_length=1)]
    crs: str | None = None


class PhotosSection(_Keys):
    """Section `imagery.photos`: folder, and whether its photos are rectified."""

    path: Annotated[str, Field(min_length=1)]
    rectified: bool = True


class ImagerySection(_Keys):
    """Section `imagery`: exemplars, unposed pictures, panoramas, posed pictures, photos, orthophoto, privacy."""

    exemplars: PathSection | None = None
    style: PathSection | None = None
    panoramas: PanoramasSection | None = None
    cameras: CamerasSection | None = None
    photos: PhotosSection | None = None
    aerial: AerialSection | None = None
    privacy: Privacy = "blur"


class ModelsSection(_Keys):
    """Section `models`: model files that replace the shipped parser, layout model and translator."""

    parser: Annotated[str, Field(min_length=1)] | None = None
    layout: Annotated[str, Field(min_length=1)] | None = None
    translator: Annotated[str, Field(min_length=1)] | None = None


# Characters of a block's name.
MAX_NAME_LENGTH = 80


class BlockFileSettings(_Keys):
    """Validated content of a block file, before any file that it names is opened."""

    name: Annotated[str, Field(pattern=rf"^\w[\w.-]{{0,{MAX_NAME_LENGTH - 1}}}$")]
    crs: str | None = None
    area: Annotated[list[float], Field(min_length=4, max_length=4), AfterValidator(_check_area)] | None = None
    buildings: BuildingsSection
    streets: StreetsSection | None = None
    ground: GroundSection | None = None
    terrain: PathSection | None = None
    imagery: ImagerySection = ImagerySection()
    texture: TextureSettings = TextureSettings()
    models: ModelsSection = ModelsSection()
    storey: Annotated[float, _float_range(2, 8)] = 3.2
    geoid_separation: Annotated[float, _float_range(-120, 120)] | Literal["auto"] | None = None
    failed_limit: Annotated[float, _float_range(0, 1)] = 0.2
    part: PartSection | None = None
    seed: Annotated[int, _int_range(0, 2**32 - 1)] = 0


def value_ranges(model: type = BlockFileSettings, prefix: str = "") -> dict[str, str]:
    """Return every dotted key with its range ("1 to 100"), or "" if it has none."""
    found: dict[str, str] = {}
    for name, hint in get_type_hints(model, include_extras=True).items():
        if name.startswith("_") or name == "model_config":
            continue
        found[prefix + name] = _bounds_text(hint)
        for nested in _alternatives(hint):
            if isinstance(nested, type) and (issubclass(nested, _Keys) or is_dataclass(nested)):
                found |= value_ranges(nested, f"{prefix}{name}.")
    return found


def validate_block_settings(values: object) -> BlockFileSettings:
    """Validate the content of a block file, and return its settings.

    Raises
    ------
    ValueError : one line "key: problem; remedy" for the first fault.
    """
    if not isinstance(values, Mapping):
        raise ValueError("holds no keys; write at least name and buildings")
    try:
        return BlockFileSettings.model_validate(values)
    except ValidationError as error:
        # A mistyped key is also reported as a missing one: the unknown key comes first.
        faults = sorted(error.errors(include_url=False), key=lambda fault: fault["type"] not in _UNKNOWN_KEY_TYPES)
        raise ValueError(_format_fault(faults[0])) from None


_UNKNOWN_KEY_TYPES = ("extra_forbidden", "unexpected_keyword_argument", "invalid_key")
# Keys of city files only.
CITY_KEYS = ("cut", "blocks")
_OUT_OF_RANGE_TYPES = ("greater_than_equal", "less_than_equal", "finite_number")
_EXPECTED_BY_TYPE = {
    "float_type": ("a number", "write it in digits, without quotes"),
    "int_type": ("a whole number", "write it in digits, without quotes"),
    "int_from_float": ("a whole number", "write it without a fraction"),
    "string_type": ("text", "write it in quotes"),
    "bool_type": ("true or false", "write one of them, without quotes"),
    "list_type": ("a list", "write [first, second, ...]"),
}


def _format_fault(fault: ErrorDetails) -> str:
    kind, value = fault["type"], fault["input"]
    key = str(fault["loc"][-1]) if kind == "invalid_key" else format_dotted_key(fault["loc"])
    if kind in _UNKNOWN_KEY_TYPES and key in CITY_KEYS:
        return f"{key}: is a key of a city, and this is to be one block; run it with `streetloom city`"
    if kind in _UNKNOWN_KEY_TYPES:
        shown = key if len(key) <= 60 else key[:57] + "..."
        return _describe_joined_key(key, shown) or f"{shown}: unknown key; {_suggest_key(key[:60])}"
    if kind == "missing":
        example = f"{key}: {{path: FILE}}" if "." not in key else "path: FILE"
        example = {"name": "name: my-block", "metres_per_pixel": "metres_per_pixel: 0.01"}.get(
            key.rpartition(".")[2], example
        )
        return f"{key}: missing; write {example}"
    if kind in ("model_type", "dataclass_type"):
        if isinstance(value, str) and (joined := _describe_joined_key(f"{key}.{value}", short_repr(value))):
            return f"{key}: {joined}"
        inner = [k.removeprefix(key + ".") for k in value_ranges() if k.startswith(key + ".")]
        example = (
            f"path: {' '.join(value.split())[:60]}"
            if "path" in inner and isinstance(value, str)
            else f"{inner[0]}: ..."
        )
        return f"{key}: holds {short_repr(value)} where keys are expected; write {key}: {{{example}}}"
    if kind in _OUT_OF_RANGE_TYPES:
        return f"{key}: {short_repr(value)} is out of range; allowed is {_range_text(key)}"
    if kind == "literal_error":
        return f"{key}: {short_repr(value)} is not known; choose {fault['ctx']['expected']}"
    if kind == "value_error":
        return f"{key}: {fault['ctx']['error']}, got {short_repr(value)}"
    if kind in ("too_short", "too_long"):
        wanted = (
            "[west, south, east, north] in degrees" if key == "area" else "at least one entry, or leave the key out"
        )
        return f"{key}: wrong number of entries, got {short_repr(value)}; give {wanted}"
    if kind == "string_pattern_mismatch":
        usable = suggest_name(str(value))
        example = f", such as {usable}" if usable else ""
        return f"{key}: {short_repr(value)} is no usable name; use letters, digits, '.', '_' and '-' only{example}"
    if kind == "string_too_short" or (kind == "string_type" and value is None):
        return f"{key}: is empty; fill it in"
    expected, remedy = _EXPECTED_BY_TYPE.get(kind, ("understood", "give another value"))
    return f"{key}: {short_repr(value)} is not {expected}; {remedy}"


def _range_text(key: str) -> str:
    """Return the range of a key, or of the entries of a list."""
    return value_ranges().get(key) or "up to 100 000 km either way"


def format_dotted_key(loc: Sequence[str | int]) -> str:
    """Format the location of a fault as a dotted key: ("area", 1) -> area[1]; ("texture", "walls") -> texture.walls."""
    end = loc.index("path") + 1 if "path" in loc else len(loc)  # pydantic appends the tried alternative, text or list
    parts = (*loc[:end], *(part for part in loc[end:] if isinstance(part, int)))
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts)
    return key.lstrip(".")


def _describe_joined_key(text: str, shown: str) -> str | None:
    """Return the message for a known key and its value without a space between them."""
    key, _, value = text.partition(":")
    if key not in value_ranges() or not value:
        return None
    return f"{shown} needs a space after the colon; write {key.rpartition('.')[2]}: {value[:60]}"


def _suggest_key(key: str) -> str:
    known = value_ranges()
    parent, _, leaf = key.rpartition(".")
    siblings = {k.rpartition(".")[2]: k for k in known if k.rpartition(".")[0] == parent}
    leaves = {k.rpartition(".")[2]: k for k in known}
    for candidates in (siblings, leaves):
        # the same key at another level comes before a similar one
        if close := difflib.get_close_matches(leaf.lower(), candidates, n=1, cutoff=0.7):
            return f"did you mean {candidates[close[0]]}?"
    return f"known here are {', '.join(siblings) or 'none'}"


def _alternatives(hint: object) -> list[object]:
    """Return the alternatives of a type hint without Optional and Annotated."""
    if get_origin(hint) is Annotated:
        return _alternatives(get_args(hint)[0])
    if get_origin(hint) in (Union, types.UnionType):
        return [member for arg in get_args(hint) for member in _alternatives(arg)]
    return [hint]


def _bounds_text(hint: object) -> str:
    bounds: dict[str, float] = {}
    for part in (hint, *get_args(hint)):
        for info in getattr(part, "__metadata__", ()):
            for bound in getattr(info, "metadata", ()):
                bounds |= {name: getattr(bound, name) for name in ("ge", "le") if hasattr(bound, name)}
    return f"{bounds['ge']} to {bounds['le']}" if len(bounds) == 2 else ""
