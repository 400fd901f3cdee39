"""Older snapshots beside the one that `current` names: their STAC files say that they are superseded, and by what."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Collection, Sequence
from typing import Any

from catalogs.published.folders import Folder, at, put, sizes_in
from catalogs.stac.parquet import MIRROR, without_links
from catalogs.stac.snapshot import COLLECTION, STAC, json_text

# Links between versions.
VERSIONS = ("predecessor-version", "latest-version")


def supersede(published: Folder, latest: str) -> None:
    """Mark the STAC files of all snapshots in the folder `published` but `latest` as deprecated, with a link to the latest
    version of the same thing where there is one. Each file is replaced in one step; one that says so already is left alone."""
    newest: Collection[str] | None = None
    for snapshot in sorted(path.name for path in published.iterdir() if path.name not in (latest, f".{latest}.tmp")):
        stac = at(published, f"{snapshot}/{STAC}")
        names = [name for name in sorted(sizes_in(stac)) if name.endswith(".json")]
        # Collections last: what has one that says so was finished
        for collection in (name for name in names if re.fullmatch(f"[^/]+/{COLLECTION}", name)):
            if _is_superseded(at(stac, collection), latest):
                continue
            if newest is None:
                newest = sizes_in(at(published, f"{latest}/{STAC}")).keys()
            kind = collection.removesuffix(COLLECTION)
            for name in [*(n for n in names if n.startswith(kind) and n != collection), collection]:
                _mark(stac, name, newest, latest)


def _is_superseded(path: Folder, latest: str) -> bool:
    try:
        fields = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return True  # nothing of ours
    return any(link["rel"] == "latest-version" and f"/{latest}/" in link["href"] for link in fields.get("links", ()))


def _mark(stac: Folder, name: str, newest: Collection[str], latest: str) -> None:
    fields: dict[str, Any] = json.loads(at(stac, name).read_text(encoding="utf-8"))
    (fields["properties"] if fields["type"] == "Feature" else fields)["deprecated"] = True
    links = [link for link in fields["links"] if link["rel"] != "latest-version"]
    if name in newest:
        media_type = "application/geo+json" if fields["type"] == "Feature" else "application/json"
        href = f"{'../' * len(name.split('/'))}../{latest}/{STAC}/{name}"
        links.append({"rel": "latest-version", "href": href, "type": media_type})
    fields["links"] = links
    put(at(stac, name), json_text(fields).encode())


def forget_versions(published: Folder) -> dict[str, list[str]]:
    """Drop the links of all STAC files in the folder `published` that lead to snapshots which are no longer there; returns the
    files that changed, by snapshot and path in it."""
    there = {path.name for path in published.iterdir() if path.is_dir()}

    def is_dead(link: dict[str, Any]) -> bool:
        return link["rel"] in VERSIONS and not there & set(re.split("/", link["href"]))

    changed: dict[str, list[str]] = defaultdict(list)
    for snapshot in sorted(name for name in there if not name.startswith(".")):
        stac = at(published, f"{snapshot}/{STAC}")
        names = sorted(sizes_in(stac))
        for name in (name for name in names if name.endswith(".json")):
            fields: dict[str, Any] = json.loads(at(stac, name).read_text(encoding="utf-8"))
            links: Sequence[dict[str, Any]] = fields.get("links", ())
            if any(map(is_dead, links)):
                fields["links"] = [link for link in links if not is_dead(link)]
                put(at(stac, name), json_text(fields).encode())
                changed[snapshot].append(f"{STAC}/{name}")
        for name in (name for name in names if re.fullmatch(f"[^/]+/{MIRROR}", name)):
            if (table := without_links(at(stac, name).read_bytes(), is_dead)) is not None:
                put(at(stac, name), table)
                changed[snapshot].append(f"{STAC}/{name}")
    return dict(changed)
