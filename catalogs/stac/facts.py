"""Facts about a snapshot's block, streets, run and models, for STAC Items."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import LineString
    from shapely.geometry.base import BaseGeometry

# States of a street; stale: a street that it reads was textured again; unseen: it sees no wall.
STREET_STATES = ("done", "failed", "stale", "waiting", "unseen")


@dataclass(frozen=True, slots=True)
class DataSourceFacts:
    """Source of a block's data.

    Attributes
    ----------
    key : key of the block file, such as buildings.path.
    name : file or folder.
    licence : None if unknown.
    """

    key: str
    name: str
    licence: str | None


@dataclass(frozen=True, slots=True)
class BlockFacts:
    """Facts about a block in one published snapshot.

    Attributes
    ----------
    crs : any user input of pyproj, in metres.
    config_digest : digest of inputs and settings.
    updated : time of its newest unit.
    footprint : union of its buildings in `crs`, None without buildings.
    counts : number of buildings, facades and so on, by name.
    settings : keys and values of the block file.
    """

    name: str
    crs: CRS | str
    snapshot: str
    code_version: str
    config_digest: str
    updated: datetime
    footprint: BaseGeometry | None
    counts: Mapping[str, int]
    settings: Mapping[str, object]
    sources: tuple[DataSourceFacts, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StreetFacts:
    """Facts about a street.

    Attributes
    ----------
    line : centreline in the block's frame, metres.
    state : one of STREET_STATES.
    viewpoints, viewpoints_done : number of viewpoints, and of those that decided texels.
    seconds : time spent on the street.
    updated : when it was textured, None if it was not yet.
    """

    id: str
    name: str | None
    line: LineString
    state: str
    reason: str | None
    viewpoints: int
    viewpoints_done: int
    key: str | None
    seconds: float | None
    updated: datetime | None


@dataclass(frozen=True, slots=True)
class RunFacts:
    """Facts about the work for a snapshot.

    Attributes
    ----------
    units : stage -> state (done, failed, stale, waiting) -> count.
    seconds : time of all units.
    """

    started: datetime
    ended: datetime
    units: Mapping[str, Mapping[str, int]]
    seconds: float


@dataclass(frozen=True, slots=True)
class ModelFacts:
    """Facts about a shipped model that the run used.

    Attributes
    ----------
    file : path from the project's root.
    card : its model card, None if it has none.
    trained_on : data set -> licence, empty if not stated.
    """

    id: str
    title: str
    file: str
    size: int
    sha256: str
    card: Path | None
    trained_on: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class SnapshotFacts:
    """Facts about a snapshot, of which each kind has Items.

    Attributes
    ----------
    run : None where the work is unknown.
    """

    block: BlockFacts
    streets: Sequence[StreetFacts] = ()
    run: RunFacts | None = None
    models: Sequence[ModelFacts] = ()
