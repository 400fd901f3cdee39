"""What viewpoints and a street cost in the store, and how much it grows by them once it is expired."""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.street.step import VIEWPOINTS, WIDTH, ingolstadt, window_of
from benchmarks.timing import bytes_in
from facade_core.atlas.arrays import create_arrays
from facade_core.atlas.journal import StreetWaveRecord, write_record
from facade_core.atlas.rasters import TexelLayout, chunk_digests, write_rasters
from facade_core.atlas.store import commit, create_root, expire_snapshots, open_repository, open_root
from facade_core.street.propagation.blend import blend_views
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import render_panorama
from facade_core.street.translator.translators import MaterialFieldTranslator

TEXELS_PER_METRE = 10.0
# Units of the other stages, as a block of this size has them: their records weigh on every commit.
OTHERS = {"poses": 0, "exemplars": 4, "textures": 0, "facades": 100, "streets": 20}


def measure(folder: Path) -> dict[str, Any]:
    """Texture one street into a store of its own, commit by commit, then expire it."""
    scene, street, own = ingolstadt(folder, TEXELS_PER_METRE)
    own = own[:VIEWPOINTS]
    window, translator = window_of(scene, own), MaterialFieldTranslator(scene, [street], seed=7)
    with tempfile.TemporaryDirectory() as temporary:
        store = Path(temporary) / "store"
        repository = open_repository(store, create=True)
        session = repository.writable_session("main")
        units = {"viewpoints": len(own), **OTHERS}
        create_arrays(create_root(session), scene.spec, units, crs="EPSG:25832", panorama_width=WIDTH)
        commit(session, "arrays")
        expire_snapshots(repository)
        empty = bytes_in(store)
        commits = []
        for viewpoint in own:
            panorama = render_panorama(scene, window, viewpoint, (WIDTH // 2, WIDTH))
            rgb = translator.translate(panorama)
            propagate_panorama(scene, window, viewpoint, rgb, charts_seen=panorama.chart)
            session = repository.writable_session("main")
            group = open_root(session)
            group["panoramas/rgb"][viewpoint.id] = rgb
            start = time.perf_counter()
            write_record(
                group, "viewpoints", viewpoint.id, {"unit": str(viewpoint.id), "key": "k" * 32, "status": "done"}
            )
            commit(session, f"viewpoint {viewpoint.id}")
            commits.append(time.perf_counter() - start)
        grown = bytes_in(store) - empty
        expire_snapshots(repository)
        expired = bytes_in(store) - empty
        raw = _panorama_bytes(repository)
        street_cost = _street(repository, store, scene, window)
        growth = {
            "kb_per_viewpoint_before_expiry": round(grown / len(own) / 1e3, 1),
            "kb_per_viewpoint_after_expiry": round(expired / len(own) / 1e3, 1),
            "kb_of_a_panorama_stored": round(raw / len(own) / 1e3, 1),
            "over_chunks_changed": round(expired / raw, 2),
        }
    return {
        "panorama_commit_ms": {
            "median": round(1000 * statistics.median(commits), 1),
            "max": round(1000 * max(commits), 1),
        },
        "growth": growth,
        "street": street_cost,
    }


def _street(repository: Any, store: Path, scene: Any, window: Any) -> dict[str, Any]:
    """The end of a street: its texels written and committed, and what of that is left after expiry."""
    before = bytes_in(store)
    held = TexelLayout.of_charts(scene.placement, window.writable)
    session = repository.writable_session("main")
    group = open_root(session)
    colour, views = blend_views(window.state)
    start = time.process_time()
    results = {"street": colour, "street_views": views, "colour": window.colour, "provenance": window.provenance}
    for name, flat in results.items():
        write_rasters(group[f"atlas/{name}"], scene.spec, scene.placement, held, flat)
    written = time.process_time()
    chunks = chunk_digests(
        group["atlas/colour"], group["atlas/provenance"], scene.spec, scene.placement, window.writable
    )
    digested = time.process_time()
    begun = time.perf_counter()
    record = StreetWaveRecord(unit="street", key="k" * 32, status="done", wave=0, digests=chunks)
    write_record(group, "streets", 0, record)
    commit(session, "street")
    committed = time.perf_counter()
    expire_snapshots(repository)
    megabytes = len(chunks) * scene.spec.chunk**2 * (3 + 2 + 3 + 1) / 1e6
    return {
        "chunks": len(chunks),
        "raw_mb": round(megabytes, 1),
        "stored_mb": round((bytes_in(store) - before) / 1e6, 1),
        "processor_ms_per_raw_mb": {
            "write": round(1000 * (written - start) / megabytes, 2),
            "digest": round(1000 * (digested - written) / megabytes, 2),
        },
        "commit_ms": round(1000 * (committed - begun), 1),
        "commit_ms_per_raw_mb": round(1000 * (committed - begun) / megabytes, 2),
    }


def _panorama_bytes(repository: Any) -> int:
    """Bytes of the chunks that the panoramas have at the newest snapshot."""
    group = open_root(repository.readonly_session("main"))
    return int(group["panoramas/rgb"].nbytes_stored())
