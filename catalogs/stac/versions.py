"""Version links between the STAC files of a run's snapshots."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Sequence

from catalogs.published.folders import Folder, file_sizes, join_path, write_atomically
from catalogs.stac.parquet import MIRROR_NAME, remove_dead_geoparquet_links
from catalogs.stac.snapshot import COLLECTION_FILE, STAC_FOLDER, stac_fields_json
from facade_core.core.json_types import JsonObject

VERSION_LINKS = ("predecessor-version", "latest-version")


def mark_superseded_snapshots(published: Folder, latest: str) -> None:
    """Mark the STAC files of all snapshots except `latest` as deprecated.

    They get a link to the latest version of the same thing. Each file is replaced atomically; marked files stay.
    """
    newest: Collection[str] | None = None
    for snapshot in sorted(path.name for path in published.iterdir() if path.name not in (latest, f".{latest}.tmp")):
        stac = join_path(published, f"{snapshot}/{STAC_FOLDER}")
        names = [name for name in sorted(file_sizes(stac)) if name.endswith(".json")]
        # Collections last: a marked Collection means that its Items are marked
        for collection in (name for name in names if re.fullmatch(f"[^/]+/{COLLECTION_FILE}", name)):
            if _is_superseded(join_path(stac, collection), latest):
                continue
            if newest is None:
                newest = file_sizes(join_path(published, f"{latest}/{STAC_FOLDER}")).keys()
            kind = collection.removesuffix(COLLECTION_FILE)
            for name in [*(n for n in names if n.startswith(kind) and n != collection), collection]:
                _deprecate_file(stac, name, newest, latest)


def _is_superseded(path: Folder, latest: str) -> bool:
    try:
        fields = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return True  # not written by Streetloom
    return any(link["rel"] == "latest-version" and f"/{latest}/" in link["href"] for link in fields.get("links", ()))


def _deprecate_file(stac: Folder, name: str, newest: Collection[str], latest: str) -> None:
    fields: JsonObject = json.loads(join_path(stac, name).read_text(encoding="utf-8"))
    (fields["properties"] if fields["type"] == "Feature" else fields)["deprecated"] = True
    links = [link for link in fields["links"] if link["rel"] != "latest-version"]
    if name in newest:
        media_type = "application/geo+json" if fields["type"] == "Feature" else "application/json"
        href = f"{'../' * len(name.split('/'))}../{latest}/{STAC_FOLDER}/{name}"
        links.append({"rel": "latest-version", "href": href, "type": media_type})
    fields["links"] = links
    write_atomically(join_path(stac, name), stac_fields_json(fields).encode())


def find_dead_version_links(published: Folder) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield each snapshot with links to snapshots that are gone, and its files without them: path in it -> content."""
    there = {path.name for path in published.iterdir() if path.is_dir()}

    def is_dead(link: JsonObject) -> bool:
        return link["rel"] in VERSION_LINKS and not there & set(re.split("/", link["href"]))

    for snapshot in sorted(name for name in there if not name.startswith(".")):
        stac = join_path(published, f"{snapshot}/{STAC_FOLDER}")
        names = sorted(file_sizes(stac))
        changed: dict[str, bytes] = {}
        for name in (name for name in names if name.endswith(".json")):
            fields: JsonObject = json.loads(join_path(stac, name).read_text(encoding="utf-8"))
            links: Sequence[JsonObject] = fields.get("links", ())
            if any(map(is_dead, links)):
                fields["links"] = [link for link in links if not is_dead(link)]
                changed[f"{STAC_FOLDER}/{name}"] = stac_fields_json(fields).encode()
        for name in (name for name in names if re.fullmatch(f"[^/]+/{MIRROR_NAME}", name)):
            if (table := remove_dead_geoparquet_links(join_path(stac, name).read_bytes(), is_dead)) is not None:
                changed[f"{STAC_FOLDER}/{name}"] = table
        if changed:
            yield snapshot, changed
