"""What a reader found against the truth: each difference needs a note or a fault that speaks of it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely
from pyproj import CRS, Transformer
from shapely.geometry.base import BaseGeometry

from benchmarks.generated_inputs.truth import CAMERA_HEIGHT_M, Case

MAX_HEIGHT_ERROR = 0.02
MAX_PLACE_ERROR_M = 0.5
MAX_AREA_ERROR = 0.05
MAX_HEADING_ERROR_DEG = 1.0
MAX_CAMERA_ERROR_M = 1.0
MAX_UV_ERROR = 0.01
OUTCOMES = (
    "right",
    "noted",
    "set aside",
    "refused",
    "refused without a remedy",
    "silent",
    "traceback",
    "hang",
    "over 3 GB",
    "killed",
)
FAULTY = OUTCOMES[4:]
# Difference -> what a line must speak of to account for it.
_SUBJECTS = {
    "height": r"height|storey|floor|level|\bunit|same outline",
    "levels": r"level|storey|floor|height|same outline",
    "base": r"ground|base|\bz\b|height",
    "missing": r"",  # told by the id, or by a count of inputs set aside
    "extra": r"number|twice|repeat|split|outline|aside|geometry",
    "place": r"swap|lies? at|zone|prefix|area of use|axes|cross|state no frame",
    "outline": r"hole|cross|outline|part|geometr|repair|mend",
    "id": r"\bids?\b|numbered|named by|row|outline|group",
    "name": r"name|text|code page|encod|utf",
    "street": r"street|name|text|code page|encod|line",
    "panorama": r"panorama|pose|heading|camera|picture",
    "heading": r"heading|yaw|angle|radian|degree",
    "camera height": r"camera|height|\bz\b",
    "photo": r"photo|picture|file",
    "uv": r"texture|picture|coordinate|uv",
}
_OTHER_HEIGHTS = re.compile(r"camera heights|heights of the ground")
_REMEDIES = (
    "give get download write export name mend take remove check save state use install leave cut draw rename add keep move set "
    "supported unpack convert holds split"
)
_REMEDY = re.compile(rf"[;:(,] *[^;]*\b(?:{'|'.join(_REMEDIES.split())}|did you mean)\b")


def judge(case: Case, answer: dict[str, Any]) -> tuple[str, list[str]]:
    """Return the outcome of a case, and the differences that led to it."""
    result, message = answer["result"], answer.get("message", "")
    if result == "refused":
        problem = _refusal_problem(message)
        return ("refused without a remedy", [problem, message]) if problem else ("refused", [message])
    if result != "read":
        return result, [message]
    if answer["warnings"]:
        return "traceback", answer["warnings"]
    found = list(_differences(case, answer))
    lines = [*answer["notes"], *answer["faults"]]
    silent = [f"{kind} {what}" for kind, id, what in found if not _is_told(kind, id, lines)]
    told = [f"{kind} {what}" for kind, _, what in found]
    if silent:
        return "silent", silent
    if answer["faults"]:
        return "set aside", told
    return ("noted", told) if found else ("right", [])


def _refusal_problem(message: str) -> str | None:
    if "\n" in message:
        return "more than one line"
    if "block.yaml" not in message:
        return "names no file"
    return None if _REMEDY.search(message) else "names no remedy"


def _is_told(kind: str, id: str | None, lines: list[str]) -> bool:
    if kind == "missing":
        words = r"aside|removed|no geometry|broken|twice|outline of another|far|lies|cross|under|outside|empty|closed"
        return any((id and id in line) or re.search(words, line, re.IGNORECASE) for line in lines)
    if kind in ("photo", "panorama") and any(id and id in line for line in lines):
        return True
    others = _OTHER_HEIGHTS if kind in ("height", "levels") else None
    return any(
        re.search(_SUBJECTS[kind], line, re.IGNORECASE) and not (others and others.search(line)) for line in lines
    )


def _differences(case: Case, answer: dict[str, Any]) -> Iterator[tuple[str, str | None, str]]:
    """Yield (kind, id, what) of each difference from the truth."""
    to_truth = Transformer.from_crs(CRS(answer["crs"]), CRS(case.place.frame), always_xy=True)

    def place(shape: BaseGeometry) -> BaseGeometry:
        return shapely.transform(shape, to_truth.transform, interleaved=False)

    found = [(one, place(shapely.from_wkt(one["outline"]))) for one in answer["buildings"]]
    outlines = [shapely.make_valid(outline) for _, outline in found]
    left = set(range(len(found)))
    if found and all(outline.distance(house.outline) > 50.0 for outline in outlines for house in case.houses):
        yield "place", None, "all of it"
        return
    for house in case.houses:
        shared = [outline.intersection(house.outline).area / house.outline.area for outline in outlines]
        best = int(np.argmax(shared)) if shared else -1
        if best < 0 or shared[best] < 0.5 or best not in left:
            if house.present:
                yield "missing", house.id, str(house.id)
            continue
        left.discard(best)
        one, outline = found[best][0], outlines[best]
        if not house.present:
            yield "extra", house.id, str(house.id)
            continue
        if outline.centroid.distance(house.outline.centroid) > MAX_PLACE_ERROR_M:
            yield "place", house.id, f"{house.id} {outline.centroid.distance(house.outline.centroid):.1f} m off"
        if abs(outline.area / house.outline.area - 1.0) > MAX_AREA_ERROR:
            yield "outline", house.id, f"{house.id} {outline.area:.0f} for {house.outline.area:.0f} m2"
        if house.height is not None and abs(one["height"] / house.height - 1.0) > MAX_HEIGHT_ERROR:
            yield "height", house.id, f"{house.id} {one['height']} for {house.height}"
        if house.levels is not None and one["levels"] != house.levels:
            yield "levels", house.id, f"{house.id} {one['levels']} for {house.levels}"
        if house.base is not None and (one["base"] is None or abs(one["base"] - house.base) > MAX_PLACE_ERROR_M):
            yield "base", house.id, f"{house.id} {one['base']} for {house.base}"
        if house.name is not None and one["name"] != house.name:
            yield "name", house.id, f"{house.id} {one['name']!r} for {house.name!r}"
        if house.id is not None and one["id"] != house.id:
            yield "id", house.id, f"{one['id']!r} for {house.id!r}"
    for index in left:
        yield "extra", found[index][0]["id"], found[index][0]["id"]
    lines = [(name, place(shapely.from_wkt(line))) for name, line in answer["streets"]]
    for name, line in case.streets.items():
        near = [one for other, one in lines if other == name]
        if not near:
            yield "street", None, f"{name!r} of {[other for other, _ in lines]}"
        elif max(one.hausdorff_distance(one.intersection(line.buffer(MAX_PLACE_ERROR_M))) for one in near) > 1.0:
            yield "street", None, f"{name!r} elsewhere"
    yield from _camera_differences(case, answer, to_truth)
    for stem in case.photos:
        if stem not in answer["photos"]:
            yield "photo", stem, stem
    if case.uv is not None and (answer["uv"] is None or np.abs(_bounds(answer["uv"], case.uv)).max() > MAX_UV_ERROR):
        yield "uv", None, f"{answer['uv']} for {case.uv}"


def _bounds(found: list[float], right: tuple[float, float, float, float]) -> Any:
    return np.array(found) - np.array([right[0], right[2], right[1], right[3]])


def _camera_differences(
    case: Case, answer: dict[str, Any], to_truth: Transformer
) -> Iterator[tuple[str, str | None, str]]:
    base = next((one["base"] for one in answer["buildings"] if one["base"] is not None), None)
    for camera in case.cameras:
        if camera.stem not in answer["panoramas"]:
            yield "panorama", camera.stem, camera.stem
            continue
        x, y, z, heading = answer["panoramas"][camera.stem]
        ahead = (x + math.sin(math.radians(heading)), y + math.cos(math.radians(heading)))
        (px, py), (qx, qy) = to_truth.transform(x, y), to_truth.transform(*ahead)
        if math.hypot(px - camera.x, py - camera.y) > MAX_PLACE_ERROR_M:
            yield "panorama", camera.stem, f"{camera.stem} {math.hypot(px - camera.x, py - camera.y):.1f} m off"
        turned = math.degrees(math.atan2(qx - px, qy - py)) - camera.heading
        if abs((turned + 180.0) % 360.0 - 180.0) > MAX_HEADING_ERROR_DEG:
            yield "heading", camera.stem, f"{camera.stem} {turned:.1f} degrees off"
        if camera.z is None:
            continue
        above = None if z is None or base is None else z - base
        if z is None or (above is not None and abs(above - CAMERA_HEIGHT_M) > MAX_CAMERA_ERROR_M):
            yield "camera height", camera.stem, f"{camera.stem} {z} over {base}, stated {camera.z}"


__all__ = ["FAULTY", "OUTCOMES", "judge"]
