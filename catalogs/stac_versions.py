"""Older snapshots beside the one that `current` names: their STAC files say that they are superseded, and by what."""

from __future__ import annotations

import json
import os
import uuid
from pathlib import Path
from typing import Any

from catalogs.stac import COLLECTION, STAC, json_text


def supersede(published: Path, latest: str) -> None:
    """Mark the STAC files of all snapshots in the folder `published` but `latest` as deprecated, with a link to the latest
    version of the same thing where there is one. Each file is replaced in one step; one that says so already is left alone."""
    for snapshot in sorted(path for path in published.iterdir() if path.name not in (latest, f".{latest}.tmp")):
        # Collections last: what has one that says so was finished
        for collection in sorted((snapshot / STAC).glob(f"*/{COLLECTION}")):
            if _is_superseded(collection, latest):
                continue
            for path in [*sorted(p for p in collection.parent.rglob("*.json") if p != collection), collection]:
                _mark(path, snapshot / STAC, published / latest / STAC, latest)


def _is_superseded(path: Path, latest: str) -> bool:
    try:
        fields = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return True  # nothing of ours
    return any(link["rel"] == "latest-version" and f"/{latest}/" in link["href"] for link in fields.get("links", ()))


def _mark(path: Path, stac: Path, newest: Path, latest: str) -> None:
    fields: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    within = path.relative_to(stac)
    (fields["properties"] if fields["type"] == "Feature" else fields)["deprecated"] = True
    links = [link for link in fields["links"] if link["rel"] != "latest-version"]
    if (newest / within).is_file():
        media_type = "application/geo+json" if fields["type"] == "Feature" else "application/json"
        href = f"{'../' * len(within.parts)}../{latest}/{STAC}/{within.as_posix()}"
        links.append({"rel": "latest-version", "href": href, "type": media_type})
    fields["links"] = links
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
    try:
        temporary.write_text(json_text(fields), encoding="utf-8", newline="")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
