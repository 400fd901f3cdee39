"""What people corrected of a block: a file beside the block file, a line for each correction, the newest of one thing counts.

Nothing is taken out of the file: what is withdrawn is a line without a value. So it tells who changed what, when and why.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from catalogs.features import Footprint, Footprints, Models
from facade_core.errors import InputError
from facade_core.labels import ELEMENT_CLASSES

SUFFIX = ".corrections.jsonl"

# What is said of facades, and of buildings.
OF_FACADES = ("elements", "hide", "keep", "facade")
OF_BUILDINGS = ("exemplar", "height", "levels")


@dataclass(frozen=True, slots=True)
class Correction:
    """One line of the file.

    Args:
        id: of a facade, or of a building.
        what: elements, hide, keep: boxes as (class, left, top, right, bottom) or without the class, shares of the wall's width
            and height, y down; facade: False of a wall that is none; exemplar: the name of one; height: metres from the ground
            to the eaves; levels: storeys.
        value: None where it is withdrawn.
        place: (longitude, latitude) of the middle of the wall or building, by which it is found under another id.
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


@dataclass(frozen=True)
class Corrections:
    """The corrections that count: id -> what -> the newest of it."""

    of: Mapping[str, Mapping[str, Correction]] = field(default_factory=dict)

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

    def digested(self) -> list[list[Any]]:
        """What a result depends on: neither who, nor when, nor why."""
        return [
            [id, what, one.value, one.place, one.width]
            for id, said in sorted(self.of.items())
            for what, one in sorted(said.items())
        ]


NONE = Corrections()


def corrections_file(block: Path) -> Path:
    """The file of a block file's corrections."""
    return block.with_suffix(SUFFIX)


def read_corrections(block: Path) -> Corrections:
    """The corrections that lie beside a block file. Raises InputError: one line with the file, the line and the remedy."""
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
            one = checked(Correction(**said | {"place": _pair(said.get("place"))}))
        except (ValueError, TypeError, AttributeError, InputError) as error:
            why = " ".join(str(error).split())[:120]
            raise InputError(f"{path}: line {number} is no correction ({why}); mend or remove it") from error
        found.setdefault(one.id, {})[one.what] = one
    counted = {id: {what: one for what, one in said.items() if one.value is not None} for id, said in found.items()}
    return Corrections({id: said for id, said in counted.items() if said})


def add_corrections(block: Path, corrections: Iterable[Correction]) -> None:
    """Write some behind those of a block file, all or none."""
    path = corrections_file(block)
    added = "".join(json.dumps(asdict(checked(one)), ensure_ascii=False, allow_nan=False) + "\n" for one in corrections)
    with _alone(path.parent):
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if text and not text.endswith("\n"):  # somebody edited it
            text += "\n"
        draft = path.with_name(f".{path.name}.draft")
        draft.write_text(text + added, encoding="utf-8")
        os.replace(draft, path)


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


def corrected_sources(
    sources: Sequence[Footprints | Models], corrections: Corrections
) -> tuple[list[Footprints | Models], tuple[str, ...]]:
    """Buildings with the heights and storeys that were corrected, and a note of those that are models, which stay as given."""
    said = corrections.of_kind(("height", "levels"))
    if not said:
        return list(sources), ()
    found: list[Footprints | Models] = []
    models: list[str] = []
    for source in sources:
        if isinstance(source, Models):
            models += [model.id for model in source.items if model.id in said]
            found.append(source)
            continue
        items = tuple(_corrected(item, said[item.id]) if item.id in said else item for item in source.items)
        found.append(replace(source, items=items))
    if not models:
        return found, ()
    return found, (f"heights corrected of buildings that are models, which stay as given: {len(models)} ({models[0]})",)


def _corrected(item: Footprint, said: Mapping[str, Correction]) -> Footprint:
    height, levels = (said[what].value if what in said else None for what in ("height", "levels"))
    return replace(item, height=height or item.height, levels=levels or item.levels)


def _pair(value: Any) -> tuple[float, float] | None:
    if value is None:
        return None
    longitude, latitude = map(float, value)
    return longitude, latitude


def _boxes(value: Any) -> tuple[tuple[float, float, float, float], ...]:
    return tuple(_box(box) for box in value)


def _box(value: Any) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = (round(min(max(float(v), 0.0), 1.0), 6) for v in value)
    if not (x0 < x1 and y0 < y1):
        raise ValueError(f"{list(value)} is no box within the wall: left, top, right, bottom as shares of it")
    return x0, y0, x1, y1


def _elements(value: Any) -> tuple[tuple[str, float, float, float, float], ...]:
    found = []
    for label, *box in value:
        if label not in ELEMENT_CLASSES:
            raise ValueError(f"{label!r} is no element; there is {', '.join(ELEMENT_CLASSES)}")
        found.append((str(label), *_box(box)))
    return tuple(sorted(found, key=lambda one: (ELEMENT_CLASSES.index(one[0]), one[2], one[1], one[3:])))


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{value!r} is neither true nor false")
    return value


def _within(least: float, most: float) -> Callable[[Any], float]:
    def number(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"{value!r} is no number")
        if not least <= value <= most:
            raise ValueError(f"{value:g} is not within {least:g} and {most:g}")
        return float(value)

    return number


def _name(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError(f"{value!r} is no name")
    return value


_VALUES: Mapping[str, Callable[[Any], Any]] = {
    "elements": _elements,
    "hide": _boxes,
    "keep": _boxes,
    "facade": _flag,
    "exemplar": _name,
    "height": _within(2.0, 1000.0),
    "levels": _within(1.0, 300.0),
}
