"""Older snapshots beside the one that `current` names: their STAC files say that they are superseded, and by what."""

from __future__ import annotations

import json
import os
import re
import uuid
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from catalogs.stac.parquet import MIRROR, without_links
from catalogs.stac.snapshot import COLLECTION, STAC, json_text

# Links between versions.
VERSIONS = ("predecessor-version", "latest-version")


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
    _replace(path, partial(_write, fields=fields))


def forget_versions(published: Path) -> dict[str, list[Path]]:
    """Drop the links of all STAC files in the folder `published` that lead to snapshots which are no longer there; returns the
    files that changed, by snapshot."""
    there = {path.name for path in published.iterdir() if path.is_dir()}

    def is_dead(link: dict[str, Any]) -> bool:
        return link["rel"] in VERSIONS and not there & set(re.split("/", link["href"]))

    changed: dict[str, list[Path]] = defaultdict(list)
    for snapshot in sorted(name for name in there if not name.startswith(".")):
        for path in sorted((published / snapshot / STAC).rglob("*.json")):
            fields: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            links: Sequence[dict[str, Any]] = fields.get("links", ())
            if any(map(is_dead, links)):
                fields["links"] = [link for link in links if not is_dead(link)]
                _replace(path, partial(_write, fields=fields))
                changed[snapshot].append(path)
        for path in sorted((published / snapshot / STAC).glob(f"*/{MIRROR}")):
            if (table := without_links(path, is_dead)) is not None:
                _replace(path, table)
                changed[snapshot].append(path)
    return dict(changed)


def _write(path: Path, fields: dict[str, Any]) -> None:
    path.write_text(json_text(fields), encoding="utf-8", newline="")


def _replace(path: Path, write: Callable[[Path], object]) -> None:
    """Put in the place of a file, in one step, what `write` writes."""
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
    try:
        write(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
