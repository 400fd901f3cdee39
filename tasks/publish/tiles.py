"""Published tiles, copied from the store, and models of the whole block merged from them."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced
from functools import partial
from pathlib import Path
from typing import TypedDict

import numpy as np

from catalogs.published.reuse import SnapshotFileWriter
from catalogs.published.snapshot import SnapshotFolder
from facade_core.atlas.journal import unit_key
from facade_core.atlas.stored_files import digest_stored_file, read_stored_file, read_verified_array, tile_paths
from facade_core.core.arrays import UInt8Array
from facade_core.export.attribution import Attribution
from facade_core.export.models.glb import replace_copyright
from facade_core.export.models.glb_merge import merge_glbs, read_glb_file_header
from facade_core.export.models.pages import downscale
from facade_core.export.models.textured_mesh import build_textured_mesh, mesh_y_up_frame
from facade_core.export.surroundings.gltf import SurroundingModel, encode_surroundings_glb
from facade_core.export.tiles.block_tiles import BlockTile, plan_block_tiles
from facade_core.export.tiles.overview import encode_overview, overview_scale, select_overview_charts
from facade_core.export.tiles.tile_model import coarse_rasters, coarse_size
from tasks.engine.stage_code import stage_code_digest
from tasks.publish.partial_failures import PartialFailures
from tasks.publish.stored_block import StoredBlock
from tasks.stages.tiles.record import TileRecord

# Largest model of the whole block, bytes: viewers and the 32-bit counts of glTF fail not far above.
MAX_MODEL_BYTES = 512_000_000


@dataclass(frozen=True)
class WrittenTile:
    """Tile that is published.

    Attributes
    ----------
    tile : plan of the tile.
    record : journal record of the tile.
    file : published file.
    sha256 : digest of the file.
    """

    tile: BlockTile
    record: TileRecord
    file: Path
    sha256: str


def write_tiles(
    snapshot: SnapshotFolder[Path],
    block: StoredBlock,
    files: SnapshotFileWriter,
    failures: PartialFailures,
    attribution: Attribution,
) -> list[WrittenTile]:
    """Write the models of tiles and their list tiles/index.json; unreadable tiles become failures.

    Stored models are copied with the attribution replaced.

    Parameters
    ----------
    snapshot : snapshot that is written.
    block : block as its store holds it.
    files : files of the snapshot; added to.
    failures : failures so far; added to.
    attribution : attribution that models name.

    Returns
    -------
    Tiles that were written.
    """
    written = []
    for tile, record in zip(plan_block_tiles(block.plan), block.journals["tiles"], strict=True):
        if record is None or record["status"] != "done":  # the journal says why
            continue
        path, digest = tile_paths(tile.path)[0], record["digest"]
        with failures.attempt(f"tile {tile.path}"):
            file = files.add_file(
                snapshot.tile(tile.path).relative_to(snapshot.folder).as_posix(),
                unit_key(attribution.line, digest),
                partial(_read_attributed_glb, block, path, digest, attribution),
            )
            with file.open("rb") as opened:
                sha256 = hashlib.file_digest(opened, "sha256").hexdigest()
            written.append(WrittenTile(tile, record, file, sha256))
    snapshot.tiles.parent.mkdir(exist_ok=True)
    snapshot.tiles.write_text(
        json.dumps(_tile_index(block, written, attribution), indent=1, ensure_ascii=False) + "\n", "utf-8"
    )
    return written


def _read_attributed_glb(block: StoredBlock, path: str, digest: str, attribution: Attribution) -> bytes:
    return replace_copyright(read_stored_file(block.group, path, digest), attribution.line)


def _tile_index(block: StoredBlock, written: Sequence[WrittenTile], attribution: Attribution) -> dict[str, object]:
    return {
        "crs": str(block.group.attrs["crs"]),
        "attribution": attribution.to_json(),
        "axes": "box: east, north, up in metres of crs; models: x east, y up, z south, around origin",
        "tiles": [
            {
                "path": entry.tile.path,
                "file": entry.file.name,
                "box": entry.record["box"],
                "origin": list(entry.tile.origin),
                "bytes": entry.file.stat().st_size,
                "sha256": entry.sha256,
                "buildings": [block.names[building] for building in entry.tile.buildings.tolist()],
            }
            for entry in written
        ],
    }


def write_surroundings_model(
    snapshot: SnapshotFolder[Path], block: StoredBlock, files: SnapshotFileWriter, attribution: Attribution
) -> None:
    """Write surroundings.glb: objects of the street, buildings and ground around the block; none where nothing is."""
    if data := _encode_surroundings(block, attribution, is_instanced=True):
        files.add_file(snapshot.surroundings.name, digest_stored_file(data), lambda: data)


def _encode_surroundings(block: StoredBlock, attribution: Attribution, *, is_instanced: bool) -> bytes:
    frame, plan = mesh_y_up_frame(block.plan.scene.mesh), block.plan
    model = SurroundingModel(plan.objects, plan.surroundings, frame, is_instanced=is_instanced)
    return b"" if model.is_empty else encode_surroundings_glb(model, _model_extras(block), attribution.line)


def write_block_model(
    snapshot: SnapshotFolder[Path],
    block: StoredBlock,
    tiles: Sequence[WrittenTile],
    files: SnapshotFileWriter,
    attribution: Attribution,
) -> bool:
    """Write block.glb, the merged tiles and the surroundings; returns whether it fits MAX_MODEL_BYTES.

    Parameters
    ----------
    snapshot : snapshot that is written.
    block : block as its store holds it.
    tiles : published tiles.
    files : files of the snapshot; added to.
    attribution : attribution that the model names.
    """
    if sum(entry.record["bytes"] for entry in tiles) > MAX_MODEL_BYTES:
        return False
    extras = _model_extras(block)
    source_key = unit_key(
        stage_code_digest("publish"),
        extras,
        attribution.line,
        [entry.record["digest"] for entry in tiles],
        block.plan.surroundings_digest,
    )

    def write(file: Path) -> None:
        with tempfile.TemporaryDirectory() as folder:
            parts = [read_glb_file_header(entry.file) for entry in tiles]
            if around := _encode_surroundings(block, attribution, is_instanced=False):
                (nodes := Path(folder) / "surroundings.glb").write_bytes(around)
                parts.append(read_glb_file_header(nodes))
            merge_glbs(file, parts, extras["origin"], extras={"crs": extras["crs"]}, copyright=attribution.line)

    files.add_file_with_writer(snapshot.model.name, source_key, write)
    return True


class _ModelExtras(TypedDict):
    """Facts in the scene of a model of the block.

    Attributes
    ----------
    origin : (3,) origin of the model, world metres.
    """

    origin: list[float]
    crs: str


def _model_extras(block: StoredBlock) -> _ModelExtras:
    return {"origin": mesh_y_up_frame(block.plan.scene.mesh).origin.tolist(), "crs": str(block.group.attrs["crs"])}


def write_overview_model(
    snapshot: SnapshotFolder[Path],
    block: StoredBlock,
    tiles: Sequence[WrittenTile],
    files: SnapshotFileWriter,
    failures: PartialFailures,
    attribution: Attribution,
) -> None:
    """Write overview.glb from the coarse rasters of tiles, without charts of unreadable tiles.

    Parameters
    ----------
    snapshot : snapshot that is written.
    block : block as its store holds it.
    tiles : published tiles.
    files : files of the snapshot; added to.
    failures : failures so far; added to.
    attribution : attribution that the model names.
    """
    extras = _model_extras(block)

    def make() -> bytes:
        scene = block.plan.scene
        # the overview may be coarser than a tile: rasters are downscaled while they are read
        source = build_textured_mesh(scene, lambda page: np.empty((0, 0, 3), np.uint8))
        texels = coarse_size(source.texels)
        charts = select_overview_charts(source)
        scale = overview_scale(texels[charts])
        size = np.maximum(1, np.ceil(texels * scale)).astype(np.int64)
        held: dict[int, UInt8Array] = {}
        wanted = set(charts.tolist())
        for rasters in read_coarse_rasters(block, tiles, failures):
            held |= {c: downscale(raster, tuple(size[c].tolist())) for c, raster in rasters.items() if c in wanted}
        charts = np.array(sorted(held), np.int64)
        whole = replaced(source, texels=size, raster=held.__getitem__)
        return encode_overview(whole, charts, extras, copyright=attribution.line)

    # the digest of a tile covers its geometry
    digests = [[entry.record["digest"], entry.record["coarse"]] for entry in tiles]
    files.add_file(
        snapshot.overview.name, unit_key(stage_code_digest("publish"), extras, attribution.line, digests), make
    )
    if any(tile_paths(entry.tile.path)[1] in failures.reasons for entry in tiles):
        del files.source_digests[snapshot.overview.name]  # an incomplete overview must not be reused


def read_coarse_rasters(
    block: StoredBlock, tiles: Sequence[WrittenTile], failures: PartialFailures
) -> Iterator[dict[int, UInt8Array]]:
    """Yield the coarse rasters of each readable tile by chart; unreadable tiles become failures."""
    texels = np.column_stack([block.plan.scene.placement.width, block.plan.scene.placement.height]).astype(np.int64)
    for entry in tiles:
        path = tile_paths(entry.tile.path)[1]
        if path in failures.reasons:
            continue
        with failures.attempt(path):
            yield coarse_rasters(
                texels, entry.tile.charts, read_verified_array(block.group, path, entry.record["coarse"])
            )
