"""STAC Collections of a published snapshot: facades, streets, blocks, runs and models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from catalogs.stac.facts import BlockFacts
from catalogs.stac.items import (
    FILE,
    PROCESSING,
    PROCESSING_LEVEL,
    PROJECTION,
    VERSION,
    collection_id,
    projection_fields,
)
from catalogs.stac.licences import common_license, licensors
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    from pystac import Collection, Item

COLLECTION_KINDS = ("facades", "streets", "blocks", "runs", "models")
_DESCRIPTIONS = {
    "facades": "Textured facades of the block {}",
    "streets": "Streets of the block {}, along which it was textured",
    "blocks": "The block {}: its textured model, table and report",
    "runs": "The run that made this snapshot of the block {}",
    "models": "Models that the block {} was made with",
}
_EARTH_BOX = [-180.0, -90.0, 180.0, 90.0]


def build_collection(
    kind: str, items: Sequence[Item], facts: BlockFacts, counts_text: str, times: Sequence[datetime]
) -> Collection:
    """Build the Collection of a kind with the extent and value ranges of its items, without links.

    Parameters
    ----------
    kind : one of COLLECTION_KINDS.
    counts_text : number of items in words.
    times : times of the items.
    """
    import pystac
    from pyproj import CRS

    # items without a location, such as models, get the whole Earth
    boxes = [item.bbox for item in items if item.bbox]
    box = [*map(min, zip(*(b[:2] for b in boxes), strict=True)), *map(max, zip(*(b[2:] for b in boxes), strict=True))]
    interval: list[datetime | None] = [min(times), max(times)] if times else [None, None]
    sources = () if kind == "models" else facts.sources  # models have licences of their own
    projection = projection_fields(CRS.from_user_input(facts.crs))
    collection = pystac.Collection(
        collection_id(facts.name, kind),
        f"{_DESCRIPTIONS[kind].format(facts.name)}: {counts_text}.",
        pystac.Extent(pystac.SpatialExtent([box or _EARTH_BOX]), pystac.TemporalExtent([interval])),
        title=f"{facts.name}: {kind}",
        stac_extensions=[FILE, PROCESSING, PROJECTION, VERSION],
        extra_fields={"version": facts.snapshot, "deprecated": False},
        keywords=["facade", "texture", "3d city model"],
        license=common_license(sources),
        providers=[
            *licensors(sources),
            pystac.Provider(
                "Streetloom",
                roles=[pystac.ProviderRole.PROCESSOR],
                extra_fields={
                    "processing:level": PROCESSING_LEVEL,
                    "processing:software": {"streetloom": facts.code_version},
                },
            ),
        ],
        summaries=pystac.Summaries(_summaries(kind, items) | {key: [value] for key, value in projection.items()}),
    )
    collection.clear_links()
    return collection


def _summaries(kind: str, items: Sequence[Item]) -> JsonObject:
    """Return the range of every number of facades and streets, and the states of items."""
    values: dict[str, list[float]] = {}
    for item in items if kind in ("facades", "streets") else ():
        for name, value in item.properties.items():
            if name.startswith("streetloom:") and isinstance(value, int | float):
                values.setdefault(name, []).append(value)
    summaries: JsonObject = {name: {"minimum": min(values[name]), "maximum": max(values[name])} for name in values}
    if states := {state for item in items if (state := item.properties.get("streetloom:status"))}:
        summaries["streetloom:status"] = sorted(states)
    return summaries


def format_counts(counts: Mapping[str, int]) -> str:
    """Format counts in words, such as "5 done, 1 failed"."""
    return ", ".join(f"{count} {name}" for name, count in counts.items())
