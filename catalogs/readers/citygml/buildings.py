"""Buildings out of CityGML 1.0, 2.0 and 3.0 files, one at a time: shells with their semantics and photo textures."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.broken import fault_reason
from catalogs.features import Fault, Model, Models, Remark, numbered
from catalogs.readers.axes import Axes, axes_of
from catalogs.readers.citygml.appearance import Appearance, add_texture, remarks_on, texture_of
from catalogs.readers.citygml.stream import elements, id_of, local_name, numbers_of
from catalogs.readers.citygml.surfaces import chosen_surfaces, rings_of, units_of
from catalogs.readers.faces import Face, shell_of
from facade_core.core.errors import GeometryError, InputError

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_METRES = frozenset(("m", "metre", "meter", "metres", "meters"))
_MOST_LEVELS = 300.0  # 9999 is a code for unknown

# rings by id, whether they are turned over, semantic
_Outline = tuple[dict[str, np.ndarray], bool, str | None]


@dataclass(slots=True)
class _Reading:
    """What a first pass finds, and what the reading of buildings adds to it. axes: by the name of the frame."""

    path: Path
    appearance: Appearance
    frame: str | None = None
    axes: dict[str, Axes] = field(default_factory=dict)
    ids: Counter[str] = field(default_factory=Counter)
    remarks: list[Remark] = field(default_factory=list)


def read_citygml(path: Path, lod: str | None = None) -> Models:
    """Every building of a file (.gml, .xml, either gzipped), in document order, parts and outer installations included.

    lod: "1" to "4" picks a level of detail, else the nearest lower one that a building has, else the nearest higher; None
    takes each building's highest. Raises InputError where the file is no well-formed CityGML.
    """
    if lod is not None and not re.fullmatch(r"[0-4](\.\d)?", lod):
        raise InputError(f"{path}: LoD {lod!r} is not known; give one of 1, 2, 3 and 4")
    reading = _survey(path)
    models: list[Model] = []
    faults: list[Fault] = []
    frame = None
    for number, building in enumerate(elements(path, ("Building",)), 1):
        id = numbered(id_of(building) or f"{path.stem}-{number}", reading.ids, reading.remarks, reading.path)
        try:
            axes, model = _model(building, id, None if lod is None else int(lod[0]), reading)
            frame = frame or axes
            if axes.horizontal != frame.horizontal:
                raise GeometryError(f"it is in {axes.crs}, the buildings before it in {frame.crs}; reproject it")
            models.append(model)
        except GeometryError as reason:
            faults.append(Fault(id, "building", f"{path.name}: {reason}", _place(building, reading)))
        except InputError:
            raise
        except Exception as error:  # whatever it holds, the others are read
            faults.append(Fault(id, "building", f"{path.name}: {fault_reason(error)}"))
    crs = frame.crs if frame else _axes(None, np.empty((0, 3)), reading).crs
    return Models(crs, tuple(models), tuple(reading.appearance.used), tuple(reading.remarks), tuple(faults))


def _survey(path: Path) -> _Reading:
    """The first pass: texture coordinates (they may stand behind the buildings), the file's frame, and whether it is sound."""
    reading = _Reading(path, Appearance(path))
    known = False
    for element in elements(path, ("Envelope", "ParameterizedTexture", "CityModel", "Building")):
        match local_name(element):
            case "Envelope":
                if len(list(element.iterancestors())) == 2:
                    reading.frame = element.get("srsName")
            case "ParameterizedTexture":
                add_texture(element, reading.appearance)
            case "Building":
                known |= "citygml" in element.tag
            case _:
                known |= element.getparent() is None
    if not known:
        raise InputError(f"{path} is XML but not CityGML: it has no CityModel; give a CityGML 1.0, 2.0 or 3.0 file")
    reading.remarks += remarks_on(reading.appearance)
    return reading


def _model(building: Element, id: str, asked: int | None, reading: _Reading) -> tuple[Axes, Model]:
    units, dangling = units_of(building)
    if dangling:
        reading.remarks.append(Remark(id, "buildings with references that lead out of them, not followed", None))
    surfaces, lod = chosen_surfaces(units, asked)
    if asked not in (None, lod):
        reading.remarks.append(Remark(id, f"buildings without LoD {asked} read at LoD {lod}", None))
    outlines = [(rings_of(surface.polygon), surface.turned, surface.semantic) for surface in surfaces]
    points = np.concatenate([ring for rings, _, _ in outlines for ring in rings.values()] or [np.empty((0, 3))])
    axes = _axes(building, points, reading)
    shell = shell_of(_faces(outlines, axes, id, reading), axes.scale)
    if shell is None:
        raise GeometryError("its surfaces enclose no area; repair or delete it")
    levels = _stated(building, "{*}storeysAboveGround")
    return axes, Model(
        id,
        shell,
        height=_stated(building, "{*}measuredHeight", "{*}Height", unit=axes.vertical),
        levels=levels if levels is not None and levels < _MOST_LEVELS else None,
        name=(building.findtext("{*}name") or "").strip() or None,
    )


def _faces(outlines: Sequence[_Outline], axes: Axes, id: str, reading: _Reading) -> list[Face]:
    """The faces seen from outside, each once, with their textures."""
    faces, misfit, known = [], False, set()
    for named, turned, semantic in sorted(outlines, key=lambda outline: outline[2] is None):
        if not named:
            continue
        rings = [axes.applied(ring) for ring in named.values()]
        corners = (rings[0] * (*axes.scale, 1.0)).round(3) + 0.0
        key = corners[np.lexsort(corners.T)].tobytes()
        repeated = semantic is None and key in known  # by a solid that does not refer to the surfaces of its boundary
        known.add(key)
        if semantic == "inside" or repeated:
            continue
        texture, uv = texture_of(named, reading.appearance)
        misfit |= texture is None
        step = -1 if turned else 1
        turned_uv = None if uv is None else [ring[::step] for ring in uv]
        index = -1 if texture is None else texture
        faces.append(Face([ring[::step] for ring in rings], semantic or "unknown", index, turned_uv))
    if misfit:
        reading.remarks.append(Remark(id, "buildings with texture coordinates that do not fit their rings", None))
    return faces


def _stated(building: Element, *tags: str, unit: float = 1.0) -> float | None:
    """The greatest positive figure of the building, else of its parts; None where none is stated in metres.

    unit: metres in one of a figure without a unit of its own.
    """
    own: list[float] = []
    parts: list[float] = []
    for element in building.iter(*tags):
        value = element if len(element) == 0 else element.find("{*}value")
        numbers = numbers_of(None if value is None else value.text)
        named = "" if value is None else re.split("[#:/]", value.get("uom", ""))[-1].lower()
        if len(numbers) == 1 and 0 < numbers[0] < math.inf and (not named or named in _METRES):
            owner = next(element.iterancestors("{*}Building", "{*}BuildingPart"), None)
            (own if owner is building else parts).append(numbers[0] * (1.0 if named else unit))
    return max(own or parts, default=None)


def _axes(building: Element | None, points: np.ndarray, reading: _Reading) -> Axes:
    """How to read a building's coordinates; the first building in a frame decides on the order of its axes."""
    own = "" if building is None else building.xpath("string((.//@srsName)[1])")
    reading.frame = reading.frame or own
    name = own or reading.frame or ""
    if name not in reading.axes:
        if len(points) == 0:
            return axes_of(name, None, reading.path)[0]
        first, second = np.median(points[:, :2], axis=0).tolist()
        reading.axes[name], remark = axes_of(name, (first, second), reading.path)
        if remark:
            reading.remarks.append(Remark(f"{name} of {reading.path.name}", remark, None))
    return reading.axes[name]


def _place(building: Element, reading: _Reading) -> shapely.Point | None:
    """Where a building is that is set aside: the median of the positions that can be read."""
    lists = [numbers_of(positions.text)[:3] for positions in building.iter("{*}posList", "{*}pos")]
    points = np.array([numbers for numbers in lists if len(numbers) == 3 and np.isfinite(numbers).all()])
    if len(points) == 0:
        return None
    middle = np.median(points, axis=0)[None]
    return shapely.Point(_axes(building, points, reading).applied(middle)[0, :2])
