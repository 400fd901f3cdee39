"""Corrections of a block or a city, in a JSON lines file next to its own.

The newest line about a value wins. Lines are never removed: a correction is withdrawn by a line without a value, so
the file is a history.
"""

from __future__ import annotations

import fcntl
import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeAlias, overload

from catalogs.block.correction_values import Box, ElementBox, parse_correction_value, parse_location, parse_width
from catalogs.block.yaml_files import read_yaml
from catalogs.printable_text import normal_form, short_repr
from catalogs.reader_errors import short_message
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import read_regular

CORRECTIONS_SUFFIX = ".corrections.jsonl"

# Kinds of corrections of facades, and of buildings.
FACADE_CORRECTION_KINDS = ("elements", "hide", "keep", "facade")
BUILDING_CORRECTION_KINDS = (
    "exemplar", "height", "levels", "roof_shape", "roof_height", "wall_material", "roof_material", "wall_colour", "roof_colour",
)  # fmt: skip

# Kinds of corrections of buildings by the type of their value.
NumberKind: TypeAlias = Literal["height", "levels", "roof_height"]
TextKind: TypeAlias = Literal["exemplar", "roof_shape", "wall_material", "roof_material", "wall_colour", "roof_colour"]


@dataclass(frozen=True, slots=True)
class Correction:
    """Line of a corrections file.

    Attributes
    ----------
    id : facade or building.
    kind : elements, hide, keep: boxes (class, left, top, right, bottom) or without the class, as shares of the wall's
        width and height, y down; facade: False if the wall is no facade; exemplar: name of an exemplar; height:
        metres from the ground to the eaves; levels: storeys; roof_shape: as OpenStreetMap's roof:shape; roof_height:
        metres from the eaves to the ridge; wall_material, roof_material: as OpenStreetMap's building:material and
        roof:material; wall_colour, roof_colour: "#rrggbb".
    value : None if withdrawn.
    place : (longitude, latitude) of the middle of the wall or inside the building, to match it under another id.
    width : width of the wall in metres.
    who, when, why : author, UTC time and reason, as given to the importer.
    """

    id: str
    kind: str
    value: Any
    place: tuple[float, float] | None = None
    width: float | None = None
    who: str = ""
    when: str = ""
    why: str = ""


# Keys of a line of the file, and the attributes of `Correction` that hold their values. Users keep these files: on a rename
# of an attribute the keys stay.
LINE_KEYS = {
    "id": "id",
    "what": "kind",
    "value": "value",
    "place": "place",
    "width": "width",
    "who": "who",
    "when": "when",
    "why": "why",
}


@dataclass(frozen=True)
class Corrections:
    """Newest corrections of a block or a city.

    Attributes
    ----------
    by_target : id -> kind -> correction.
    new_ids : old id -> new id of corrections that were matched by location.
    """

    by_target: Mapping[str, Mapping[str, Correction]] = field(default_factory=dict)
    new_ids: Mapping[str, str] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.by_target)

    @overload
    def value_correction(self, id: str, kind: Literal["elements"]) -> tuple[ElementBox, ...] | None: ...
    @overload
    def value_correction(self, id: str, kind: Literal["hide", "keep"]) -> tuple[Box, ...] | None: ...
    @overload
    def value_correction(self, id: str, kind: Literal["facade"]) -> bool | None: ...
    @overload
    def value_correction(self, id: str, kind: NumberKind) -> float | None: ...
    @overload
    def value_correction(self, id: str, kind: TextKind) -> str | None: ...
    @overload
    def value_correction(self, id: str, kind: str) -> Any: ...
    def value_correction(self, id: str, kind: str) -> Any:
        """Return the corrected value, or None if there is none."""
        found = self.by_target.get(id, {}).get(kind)
        return None if found is None else found.value

    def select_kinds(self, kinds: Sequence[str]) -> dict[str, dict[str, Correction]]:
        """Return the corrections of some kinds, by id."""
        chosen = {
            id: {kind: correction for kind, correction in by_kind.items() if kind in kinds}
            for id, by_kind in self.by_target.items()
        }
        return {id: by_kind for id, by_kind in chosen.items() if by_kind}

    def rename_targets(self, names: Mapping[str, str]) -> Corrections:
        """Return corrections with new ids; a correction of the new id wins over one of the old id."""
        if not (known := {id: name for id, name in names.items() if id in self.by_target}):
            return self
        merged: dict[str, dict[str, Correction]] = {}
        for id in (*known, *(id for id in self.by_target if id not in known)):
            name = known.get(id, id)
            merged.setdefault(name, {}).update(
                {kind: replace(correction, id=name) for kind, correction in self.by_target[id].items()}
            )
        return Corrections(merged, {**self.new_ids, **known})

    def digest_inputs(self) -> list[list[object]]:
        """Return the values that a result depends on, without author, time and reason."""
        return [
            [id, kind, correction.value, correction.place, correction.width]
            for id, by_kind in sorted(self.by_target.items())
            for kind, correction in sorted(by_kind.items())
        ]


NO_CORRECTIONS = Corrections()


def city_or_block_file(block: Path) -> Path:
    """Return the path of the block file, or of its city's file if the block is a part of a city."""
    try:
        values = read_yaml(block)
    except (OSError, ValueError):  # the reader reports an invalid block file
        return block
    part = values.get("part") if isinstance(values, dict) else None
    city = part.get("city") if isinstance(part, dict) else None
    return Path(os.path.normpath(block.parent / city)) if isinstance(city, str) else block


def corrections_file(block: Path) -> Path:
    """Return the path of the corrections of a block or a city."""
    return city_or_block_file(block).with_suffix(CORRECTIONS_SUFFIX)


def read_corrections(block: Path) -> Corrections:
    """Read the corrections of a block or a city.

    Raises
    ------
    InputError : one line with the file, the line number and the remedy.
    """
    path = corrections_file(block)
    try:
        state = path.stat()
        return _read_corrections_file(path, (state.st_ino, state.st_size, state.st_mtime_ns))
    except FileNotFoundError:
        return NO_CORRECTIONS
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"{path} cannot be read ({short_message(error)}); mend it, or restore it from a copy"
        ) from error


@lru_cache(maxsize=4)
def _read_corrections_file(path: Path, state: tuple[int, int, int]) -> Corrections:
    """Read a corrections file, once for each state of it: a run reads it for the block and for its city."""
    text = normal_form(read_regular(path).decode("utf-8-sig"))  # editors of Windows add a byte order mark
    newest: dict[str, dict[str, Correction]] = {}
    for number, line in enumerate(text.split("\n"), start=1):  # splitlines would split at other separators too
        if not line.strip():
            continue
        try:
            correction = _parse_line(json.loads(line))
        except (ValueError, TypeError, AttributeError, RecursionError, InputError) as error:
            why = short_message(error).replace(" at line 1, ", " at ")
            raise InputError(f"{path}: line {number} is no correction ({why}); mend or remove it") from error
        newest.setdefault(correction.id, {})[correction.kind] = correction
    active = {
        id: {kind: correction for kind, correction in entry.items() if correction.value is not None}
        for id, entry in newest.items()
    }
    return Corrections({id: entry for id, entry in active.items() if entry})


def _parse_line(entry: object) -> Correction:
    """Return an object of a corrections file as a correction; InputError or ValueError for an invalid one."""
    if not isinstance(entry, dict):
        raise InputError("it is no object in braces")
    if unknown := entry.keys() - LINE_KEYS.keys():
        raise InputError(f"it has the unknown key {short_repr(min(unknown))}; there is {', '.join(LINE_KEYS)}")
    if missing := [key for key in ("id", "what", "value") if key not in entry]:
        raise InputError(f"it lacks {' and '.join(missing)}")
    id, kind = entry["id"], entry["what"]
    values = {LINE_KEYS[key]: value for key, value in entry.items()}
    values["value"] = parse_correction_value(id, kind, entry["value"])
    values["place"] = parse_location(entry.get("place"))
    values["width"] = parse_width(entry.get("width"))
    return Correction(**values)


def append_corrections_to_file(block: Path, corrections: Iterable[Correction]) -> None:
    """Append corrections to the corrections file of a block or its city; either all or none are written.

    Raises
    ------
    InputError : a correction is invalid, or holds characters that cannot be encoded.
    """
    lines = [
        json.dumps(_line_values(validate_correction(correction)), ensure_ascii=False, allow_nan=False)
        for correction in corrections
    ]
    path = corrections_file(block)
    try:
        "".join(lines).encode("utf-8")
    except UnicodeEncodeError as error:  # lone surrogates, which JSON and command lines may hold
        raise InputError(
            f"{path}: what is to be kept has letters that are none; write names and reasons anew"
        ) from error
    _append_lines(path, "".join(f"{line}\n" for line in lines))


def _line_values(correction: Correction) -> JsonObject:
    return {key: getattr(correction, attribute) for key, attribute in LINE_KEYS.items()}


def _append_lines(path: Path, added: str) -> None:
    """Append to a file atomically and durably; a link stays one, and the file keeps its mode."""
    path = path.resolve()
    with lock_input_folder(path.parent):
        there = path.exists()
        text = read_regular(path).decode("utf-8-sig") if there else ""
        if text and not text.endswith("\n"):  # edited by hand
            text += "\n"
        draft = path.with_name(f".{path.name}.draft")
        with draft.open("w", encoding="utf-8") as file:
            if there:
                os.fchmod(file.fileno(), stat.S_IMODE(path.stat().st_mode))
            file.write(text + added)
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


@contextmanager
def lock_input_folder(folder: Path) -> Iterator[None]:
    """Hold an exclusive lock on a folder, so that concurrent additions are not lost."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def validate_correction(correction: Correction) -> Correction:
    """Validate a correction, and return it with its value normalised.

    Raises
    ------
    InputError : unknown kind, missing id or invalid value.
    """
    value = parse_correction_value(correction.id, correction.kind, correction.value)
    return replace(correction, value=value)
