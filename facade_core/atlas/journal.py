"""The journal: one record per unit of work, in the same commit as the unit's data.

Each stage has a string array, one element and one chunk per unit. A record is JSON with at least `unit` and `key`; a unit is
done when its record's key equals the key that its inputs have now.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any, Required, TypedDict

import numpy as np

from facade_core.atlas.journal_cache import read_cached_array
from facade_core.core.zarr_types import StoreGroup


class Record(TypedDict, total=False):
    """What the journal says of a unit.

    unit, key: its name, and what it stands on.
    status: done, failed, or stale: known, and due again.
    reason: why it failed or is stale, or which picture was refused; traceback: where that was.
    worker, started, seconds: where and when it was done, seconds since 1970, and how long each step took.
    """

    unit: Required[str]
    key: Required[str]
    status: Required[str]
    reason: str
    traceback: str
    worker: str
    started: float
    seconds: dict[str, float]
    # of all that write charts: the digest of each chart by its id
    digests: dict[str, str]
    # panoramas: x, y, z, heading, pitch, roll; what refining did; degrees between lines and axes before and after
    pose: list[Any]
    moved_m: float
    turned_deg: float
    given_deg: float | None
    residual_deg: float | None
    left: list[str]
    # the covariance of place and heading, metres and degrees, as outlines of buildings tell them; None where they do not
    spread: list[list[float]] | None
    # bundles: by panorama its pose refined alone, and what of its own record is another once it was refined with others
    together: Any
    # panoramas that were: on how many surfaces others agree, why they keep
    # the pose refined alone, how far apart what both show of these lay and lies, median, metres
    shared: int
    kept_alone: str
    apart_before_m: float | None
    apart_m: float | None
    # panoramas: how high over the ground they were taken, None where the block has none there, and its colours around
    over_ground_m: float | None
    squares: list[list[int]]
    # ground from panoramas: of each camera that shows it the panorama, its share and how far it was on the mean, metres
    cameras: list[list[Any]]
    # exemplars: their size at the block's density, what was masked of them, what of their wall is in shadow, and what tells
    # their style, `facade_core.plan.exemplar_style.look_of`
    width_m: float
    height_m: float
    hidden: float
    shaded: float
    look: list[float]
    metres_per_pixel: float
    metres_per_texel: float
    # textured buildings: how many charts
    charts: int
    # facades, and floors, columns and shop_width of exemplars too
    source: str
    capture_date: str | None
    # of those that an earlier capture shows too: of what both show the share that changed, what of the facade that is, its day
    changed: float | None
    compared: float
    capture_date_before: str | None
    # where it changed, `SquareAgreement.by_cell`; where the store has a picture of how it was, and its
    # digest
    change_map: list[str]
    before_file: str
    before_digest: str
    floors: int
    columns: int
    elements: list[list[Any]]
    lattice: dict[str, list[int]]
    windows: int
    doors: int
    balconies: int
    shops: int
    windows_seen: int
    doors_seen: int
    balconies_seen: int
    shops_seen: int
    shop_width: float
    window_to_wall: float
    # of facades from pictures
    window_to_wall_low: float
    window_to_wall_high: float
    windows_low: int
    windows_high: int
    floors_low: int
    floors_high: int
    occluded: float
    masked: list[list[int]]
    masked_share: float
    privacy: str
    # whether faces and plates were looked for, of exemplars too; what was read over shops, None where that was not looked for
    looked: bool
    shop_names: str | None
    # of photos, `tasks.stages.facades.evidence.Fit`; of exemplars whether a facade was found in them
    cut_kept: float
    cut_found: bool
    stretched: float
    provenance: list[float]
    variation_types: int
    variation_levels: int
    variation_bytes: int
    # where the store has the file of the variations, and its digest
    variation_file: str
    variation_digest: str
    layout_score: float | None
    # viewpoints: digests of the panorama, and of what other streets take of it; the share that was textured before
    panorama: str
    passes: str
    textured: float
    texels: int
    # pages, tiles, pictures: the file's length and digest; of a tile its box, digests of its coarse rasters and of how its
    # pictures lie, and what each of these is made of
    bytes: int
    digest: str
    box: list[list[float]]
    coarse: str
    shape: str
    made_of: list[str]
    # pictures: the name of their file in the store, of a facade's the name, title, offset and length of each in it; whether one
    # failed as the store could not be read
    file: str
    pictures: list[list[Any]]
    unread: bool
    # streets: their wave, what they are made of, and seconds of each viewpoint's commit
    wave: int
    chain: str
    commits: list[float]


# Fields of a record that may differ between two runs of the same unit on the same input.
VOLATILE_FIELDS = ("worker", "seconds", "started", "commits", "traceback")


def read_journal(group: StoreGroup, stage: str) -> list[Record | None]:
    """All records of a stage by unit index, None where there is none; no units where the store is older than the stage."""
    if f"journal/{stage}" not in group:
        return []
    return [json.loads(text) if text else None for text in read_cached_array(group, f"journal/{stage}")]


def read_records(group: StoreGroup, stage: str, units: np.ndarray) -> list[Record | None]:
    """The records of some units of a stage, by their indices (n,), in that order; None of each where the store is from before
    the stage."""
    if f"journal/{stage}" not in group:
        return [None] * len(units)
    texts = group[f"journal/{stage}"].oindex[units] if len(units) else []
    return [json.loads(str(text)) if text else None for text in texts]


def write_record(group: StoreGroup, stage: str, index: int, record: Record) -> None:
    group[f"journal/{stage}"][index] = json.dumps(record, sort_keys=True, allow_nan=False)


def clear_record(group: StoreGroup, stage: str, index: int) -> None:
    """Make a unit due again, which it is in a store from before its stage."""
    if f"journal/{stage}" in group:
        group[f"journal/{stage}"][index] = ""


def unit_key(*parts: Any) -> str:
    """The key of a unit: a digest of everything that its result depends on (strings, numbers, nested lists and dicts)."""
    return hashlib.blake2b(json.dumps(parts, sort_keys=True).encode(), digest_size=16).hexdigest()


def latest_digests(base_records: list[Record | None], street_records: list[Record | None]) -> dict[str, str]:
    """Digest of every chart, by its id, as the last of those who share its arrays left it: those of `seeds` each have charts of
    their own, streets write in the order of their waves."""
    charts: dict[str, str] = {}
    for record in base_records:
        if record:
            charts.update(record.get("digests", {}))
    for record in sorted((r for r in street_records if r), key=lambda r: (r["wave"], r["unit"])):
        charts.update(record["digests"])
    return charts


def atlas_digest(group: StoreGroup) -> str:
    """One digest of the whole atlas: of the charts' digests in the order of their ids, wherever they lie on the pages."""
    charts = latest_digests(read_journal(group, "surfaces"), [])
    digest = hashlib.sha256()
    for name in sorted(charts):
        digest.update(f"{name}:{charts[name]}\n".encode())
    return digest.hexdigest()
