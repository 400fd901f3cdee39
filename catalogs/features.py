"""Footprints and centrelines as a source states them, before they become buildings and streets of a block."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shapely import LineString, MultiPolygon, Polygon


@dataclass(frozen=True, slots=True)
class Footprint:
    """A building outline in the source's frame. height: metres from the ground to the eaves; None where unstated."""

    id: str
    outline: Polygon | MultiPolygon
    height: float | None
    levels: float | None
    name: str | None


@dataclass(frozen=True, slots=True)
class Remark:
    """What a reader did to one outline: reason is a plural, e.g. "roofs without walls set aside"."""

    id: str
    reason: str
    outline: Any


@dataclass(frozen=True, slots=True)
class Centreline:
    """A piece of street centreline in the source's frame; pieces of one name are merged later."""

    id: str
    line: LineString
    name: str | None


@dataclass(frozen=True, slots=True)
class Footprints:
    """All outlines of one source, the frame they are in, and what the reader remarks on some."""

    crs: str
    items: tuple[Footprint, ...]
    remarks: tuple[Remark, ...] = ()


@dataclass(frozen=True, slots=True)
class Centrelines:
    """All centrelines of one source and the frame they are in."""

    crs: str
    items: tuple[Centreline, ...]


def natural_order(identifier: str) -> tuple[tuple[str, int], ...]:
    """Sort key that puts w9 before w10."""
    return tuple((text, int(number or -1)) for text, number in re.findall(r"(\D*)(\d*)", identifier))


def notes_by_reason(reasons: Mapping[str, Iterable[str]], *, listed: int = 8) -> tuple[str, ...]:
    """One note per reason, with the number of features it concerns and the first ids."""
    notes = []
    for reason, found in reasons.items():
        ids = sorted(found, key=natural_order)
        if ids:
            more = f" and {len(ids) - listed} more" if len(ids) > listed else ""
            notes.append(f"{reason}: {len(ids)} ({', '.join(ids[:listed])}{more})")
    return tuple(notes)
