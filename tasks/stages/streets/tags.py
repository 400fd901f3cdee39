"""Tags of the snapshots in which streets ended."""

from __future__ import annotations

from catalogs.features import safe_file_stem
from facade_core.atlas.journal import Record, read_journal, unit_key
from facade_core.core.zarr_types import StoreGroup


def street_commit_tag(record: Record) -> str:
    """Return the tag of the snapshot in which a street ended, by the street's record."""
    return f"street-{safe_file_stem(record['unit'])}-{unit_key(record['key'])[:12]}"


def list_street_commit_tags(group: StoreGroup) -> set[str]:
    """Return the tags of the streets that a snapshot holds as done."""
    return {
        street_commit_tag(record) for record in read_journal(group, "streets") if record and record["status"] == "done"
    }
