"""What people corrected of a block or a city: a file beside its own, a line for each, the newest of one thing counts.

Nothing is taken out of the file: what is withdrawn is a line without a value. So it tells who changed what, when and why.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from catalogs.block.yaml_files import read_yaml
from catalogs.readers.vectors.colours import parse_colour
from facade_core.core.errors import InputError
from facade_core.core.labels import ELEMENT_CLASSES

SUFFIX = ".corrections.jsonl"
# Letters of a material or a roof's shape.
LONGEST_WORD = 64

# What is said of facades, and of buildings.
OF_FACADES = ("elements", "hide", "keep", "facade")
OF_BUILDINGS = (
    "exemplar", "height", "levels", "roof_shape", "roof_height", "wall_material", "roof_material", "wall_colour", "roof_colour",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Correction:
    """One line of the file.

    Args:
        id: of a facade, or of a building.
        what: elements, hide, keep: boxes as (class, left, top, right, bottom) or without the class, shares of the wall's width
            and height, y down; facade: False of a wall that is none; exemplar: the name of one; height: metres from the ground
            to the eaves; levels: storeys; roof_shape: as OpenStreetMap's roof:shape; roof_height: metres from the eaves to the
            ridge; wall_material, roof_material: as OpenStreetMap's building:material and roof:material; wall_colour,
            roof_colour: "#rrggbb".
        value: None where it is withdrawn.
        place: (longitude, latitude) of the middle of the wall, or in the building, by which it is found under another id.
        width: of the wall, metres.
        who, when, why: as the importer was told; when is UTC.
    """

    id: str
    what: str
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
    "what": "what",
    "value": "value",
    "place": "place",
    "width": "width",
    "who": "who",
    "when": "when",
    "why": "why",
}


@dataclass(frozen=True)
class Corrections:
    """The corrections that count: id -> what -> the newest of it. renamed: of what is known by its place, the id that it was
    corrected under -> its own."""

    of: Mapping[str, Mapping[str, Correction]] = field(default_factory=dict)
    renamed: Mapping[str, str] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.of)

    def value(self, id: str, what: str) -> Any:
        """What something is corrected to, None where it is not."""
        found = self.of.get(id, {}).get(what)
        return None if found is None else found.value

    def of_kind(self, kinds: Sequence[str]) -> dict[str, dict[str, Correction]]:
        """Those of facades, or of buildings, by id."""
        chosen = {id: {what: one for what, one in said.items() if what in kinds} for id, said in self.of.items()}
        return {id: said for id, said in chosen.items() if said}

    def under(self, names: Mapping[str, str]) -> Corrections:
        """The same with other ids for those that `names` has: of what is said of one under both, its own is newer."""
        if not (known := {id: name for id, name in names.items() if id in self.of}):
            return self
        found: dict[str, dict[str, Correction]] = {}
        for id in (*known, *(id for id in self.of if id not in known)):
            name = known.get(id, id)
            found.setdefault(name, {}).update({what: replace(one, id=name) for what, one in self.of[id].items()})
        return Corrections(found, {**self.renamed, **known})

    def digested(self) -> list[list[Any]]:
        """What a result depends on: neither who, nor when, nor why."""
        return [
            [id, what, one.value, one.place, one.width]
            for id, said in sorted(self.of.items())
            for what, one in sorted(said.items())
        ]


NONE = Corrections()


def home_of(block: Path) -> Path:
    """The file beside which corrections of a block lie: its own, or the city's of which it is a part."""
    try:
        values = read_yaml(block)
        city = values["part"]["city"]
    except (OSError, ValueError, KeyError, TypeError):  # one that is no block file is refused when it is read
        return block
    return Path(os.path.normpath(block.parent / city)) if isinstance(city, str) else block


def corrections_file(block: Path) -> Path:
    """The file of a block's or a city's corrections."""
    return home_of(block).with_suffix(SUFFIX)


def read_corrections(block: Path) -> Corrections:
    """The corrections that lie beside the file of a block or a city.

    Raises InputError: one line with the file, the line and the remedy.
    """
    path = corrections_file(block)
    try:
        lines = path.read_text(encoding="utf-8").split("\n")  # some of what a text holds breaks lines elsewhere
    except FileNotFoundError:
        return NONE
    except (OSError, UnicodeError) as error:
        raise InputError(f"{path} cannot be read ({error}); restore it, or move it away") from error
    found: dict[str, dict[str, Correction]] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            said = json.loads(line)
            values = said | {"place": _pair(said.get("place"))}
            one = checked(Correction(**{LINE_KEYS.get(key, key): value for key, value in values.items()}))
        except (ValueError, TypeError, AttributeError, InputError) as error:
            why = " ".join(str(error).split())[:120]
            raise InputError(f"{path}: line {number} is no correction ({why}); mend or remove it") from error
        found.setdefault(one.id, {})[one.what] = one
    counted = {id: {what: one for what, one in said.items() if one.value is not None} for id, said in found.items()}
    return Corrections({id: said for id, said in counted.items() if said})


def add_corrections(block: Path, corrections: Iterable[Correction]) -> None:
    """Write some behind those of a block file, all or none."""
    lines = [json.dumps(_line_values(checked(one)), ensure_ascii=False, allow_nan=False) for one in corrections]
    path = corrections_file(block)
    try:
        "".join(lines).encode("utf-8")
    except UnicodeEncodeError as error:  # halves of letters, which JSON and command lines may hold
        raise InputError(
            f"{path}: what is to be kept has letters that are none; write names and reasons anew"
        ) from error
    _add(path, "".join(f"{line}\n" for line in lines))


def _line_values(correction: Correction) -> dict[str, Any]:
    return {key: getattr(correction, attribute) for key, attribute in LINE_KEYS.items()}


def _add(path: Path, added: str) -> None:
    with _alone(path.parent):
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if text and not text.endswith("\n"):  # somebody edited it
            text += "\n"
        draft = path.with_name(f".{path.name}.draft")
        draft.write_text(text + added, encoding="utf-8")
        os.replace(draft, path)


def adopt_corrections(city: Path, folder: Path) -> None:
    """Put those that lie beside block files of a city in a folder, where an older version kept them, beside the city's own."""
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        _add(corrections_file(city), path.read_text(encoding="utf-8"))
        path.unlink()


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Wait until no other process or thread adds corrections in a folder: of two at once one would be lost."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def checked(one: Correction) -> Correction:
    """A correction as it counts. Raises InputError where it says nothing that can be."""
    if one.what not in (*OF_FACADES, *OF_BUILDINGS):
        raise InputError(
            f"{one.what!r} is nothing that can be corrected; there is {', '.join((*OF_FACADES, *OF_BUILDINGS))}"
        )
    if not isinstance(one.id, str) or not one.id:
        raise InputError("it names no facade or building")
    if one.value is None:
        return one
    try:
        return replace(one, value=_VALUES[one.what](one.value))
    except (TypeError, ValueError, IndexError) as error:
        raise InputError(f"{one.what} of {one.id}: {error}") from error


def _pair(value: Any) -> tuple[float, float] | None:
    if value is None:
        return None
    longitude, latitude = map(float, value)
    if not (math.isfinite(longitude) and math.isfinite(latitude)):
        raise ValueError(f"{value} is no place; give longitude and latitude")
    return longitude, latitude


def _told(value: Any) -> str:
    """A value as a line tells it."""
    text = repr(value)
    return text if len(text) <= LONGEST_WORD else f"{text[:LONGEST_WORD]}..."


def is_number(value: Any) -> bool:
    """Whether a value out of JSON is a number that counts something."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number beyond all others
        return False


def _listed(value: Any) -> Sequence[Any]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{_told(value)} is no list of boxes")
    return value


def _boxes(value: Any) -> tuple[tuple[float, float, float, float], ...]:
    return tuple(_box(box) for box in _listed(value))


def _box(value: Any) -> tuple[float, float, float, float]:
    if isinstance(value, list | tuple) and len(value) == 4 and all(map(is_number, value)):
        x0, y0, x1, y1 = (round(min(max(float(v), 0.0), 1.0), 6) for v in value)
        if x0 < x1 and y0 < y1:
            return x0, y0, x1, y1
    raise ValueError(f"{_told(value)} is no box within the wall: left, top, right, bottom as shares of it")


def _elements(value: Any) -> tuple[tuple[str, float, float, float, float], ...]:
    found = set()  # what is said twice is there once
    for one in _listed(value):
        label, *box = one if isinstance(one, list | tuple) and one else (one,)
        if label not in ELEMENT_CLASSES:
            raise ValueError(f"{_told(label)} is no element; there is {', '.join(ELEMENT_CLASSES)}")
        found.add((str(label), *_box(box)))
    return tuple(sorted(found, key=lambda one: (ELEMENT_CLASSES.index(one[0]), one[2], one[1], one[3:])))


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{_told(value)} is neither true nor false")
    return value


def _within(least: float, most: float) -> Callable[[Any], float]:
    def number(value: Any) -> float:
        if not is_number(value):
            raise ValueError(f"{_told(value)} is no number")
        if not least <= value <= most:
            raise ValueError(f"{value:g} is not within {least:g} and {most:g}")
        return float(value)

    return number


def _name(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError(f"{_told(value)} is no name")
    return value


def _word(value: Any) -> str:
    if not isinstance(value, str) or not value.strip() or len(value) > LONGEST_WORD:
        raise ValueError(f"{_told(value)} is no word for a material or a roof, such as brick")
    return value.strip().lower()


def _colour(value: Any) -> str:
    found = parse_colour(value) if isinstance(value, str) else None
    if found is None:
        raise ValueError(f"{_told(value)} is no colour; write one as #a0522d")
    return "#{:02x}{:02x}{:02x}".format(*found)


_VALUES: Mapping[str, Callable[[Any], Any]] = {
    "elements": _elements,
    "hide": _boxes,
    "keep": _boxes,
    "facade": _flag,
    "exemplar": _name,
    "height": _within(2.0, 1000.0),
    "levels": _within(1.0, 300.0),
    "roof_shape": _word,
    "roof_height": _within(0.1, 100.0),
    "wall_material": _word,
    "roof_material": _word,
    "wall_colour": _colour,
    "roof_colour": _colour,
}
