"""What a published snapshot says of its block, streets, run and models: what their STAC Items are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shapely import LineString
    from shapely.geometry.base import BaseGeometry

# Of a street: textured; not textured, and why; textured before one that it reads was done again; still to do; without walls.
STATES = ("done", "failed", "stale", "waiting", "unseen")


@dataclass(frozen=True, slots=True)
class SourceFact:
    """What a block was made from. key: of the block file, such as buildings.path; licence: None where it is not known."""

    key: str
    name: str
    licence: str | None


@dataclass(frozen=True, slots=True)
class BlockFacts:
    """A block in one published snapshot.

    crs: any user input of pyproj, metres. config_digest: of inputs and settings. updated: when its newest unit was made.
    footprint: of its buildings, in `crs`, None where they have none. counts: of buildings, facades ... by name. settings: the
    block file's keys and values.
    """

    name: str
    crs: Any
    snapshot: str
    code_version: str
    config_digest: str
    updated: datetime
    footprint: BaseGeometry | None
    counts: Mapping[str, int]
    settings: Mapping[str, Any]
    sources: tuple[SourceFact, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StreetFacts:
    """A street: centreline in the block's frame, metres; its viewpoints, and how many of them are textured.

    wave: which streets that share no chunk it is textured with. texels: those that it wrote; coverage: their share of those
    that it may write. seconds: spent on it and its viewpoints; updated: when it was made; None where it was not yet.
    """

    id: str
    name: str | None
    line: LineString
    state: str
    reason: str | None
    viewpoints: int
    viewpoints_done: int
    wave: int
    texels: int | None
    coverage: float | None
    key: str | None
    seconds: float | None
    updated: datetime | None


@dataclass(frozen=True, slots=True)
class RunFacts:
    """The work behind a snapshot. units: stage -> state (done, failed, stale, waiting) -> how many; seconds: of all units."""

    started: datetime
    ended: datetime
    units: Mapping[str, Mapping[str, int]]
    seconds: float


@dataclass(frozen=True, slots=True)
class ModelFacts:
    """A shipped model that the run used. file: from the project's root; card: its model card, None where it has none;
    trained_on: set -> licence, empty where that is not stated."""

    id: str
    title: str
    file: str
    size: int
    sha256: str
    card: Path | None
    trained_on: Mapping[str, str]
