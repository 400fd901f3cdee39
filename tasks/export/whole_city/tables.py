"""Map of a city: the layers of all blocks in one GeoPackage, or in one GeoParquet file each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

from catalogs.published.geopackage import GeoPackageWriter
from catalogs.published.geoparquet import encode_layer, write_geoparquet
from catalogs.published.map_layers import LAYER_NAMES, RUN_COLUMN
from facade_core.core.arrays import IntArray
from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import Attribution
from tasks.export.maps import map_layers
from tasks.export.whole_city.parts import BLOCKS_FOLDER, CityFacts, Part
from tasks.publish.published_run import PublishedBlock


def write_map_pieces(
    results: PublishedBlock, buildings: IntArray, part: Part, city: CityFacts, options: JsonObject
) -> tuple[list[str], list[str], JsonObject]:
    """Write LAYER.parquet of a block as pieces, with the block's folder in a column as `streetloom query` has it.

    Returns
    -------
    files : files to open first; none.
    notes : remarks for the user.
    facts : time of the newest row of the catalogue.
    """
    layers, updated = map_layers(results, buildings)
    for name, rows in layers.items():
        named = rows.assign(**{RUN_COLUMN: f"{BLOCKS_FOLDER}/{part.block}"})
        (part.pieces / f"{name}.parquet").write_bytes(encode_layer(named))
    return [], [], {"updated": updated.isoformat() if updated else ""}


def join_geopackage(
    folder: Path, parts: Sequence[Part], markers: Iterator[JsonObject], city: CityFacts, attribution: Attribution
) -> list[str]:
    """Write CITY.gpkg of the pieces of all blocks; return its name."""
    import geopandas as gpd
    import pandas as pd

    name = f"{city.stem}.gpkg"
    (folder / name).unlink(missing_ok=True)  # of an export that was killed
    times = [marker["facts"]["updated"] for marker in markers if marker["facts"]["updated"]]
    updated = max(map(datetime.fromisoformat, times), default=None)
    writer = GeoPackageWriter(folder / name, attribution.tags(), updated)
    for layer in LAYER_NAMES:
        read = pd.read_parquet if layer == "set_aside" else gpd.read_parquet
        for piece in _pieces(parts, layer):
            writer.append_layer(layer, read(piece))
    writer.write_styles()
    return [name]


def join_geoparquet(
    folder: Path, parts: Sequence[Part], markers: Iterator[JsonObject], city: CityFacts, attribution: Attribution
) -> list[str]:
    """Write LAYER.parquet of the pieces of all blocks; return the names of those with rows."""
    names = []
    for layer in LAYER_NAMES:
        if pieces := list(_pieces(parts, layer)):
            names.append(f"{layer}.parquet")
            write_geoparquet(folder / names[-1], pieces, attribution.tags())
    return names


def _pieces(parts: Sequence[Part], layer: str) -> Iterator[Path]:
    """Yield the pieces of a layer, in the order of the blocks."""
    return (piece for part in parts if (piece := part.pieces / f"{layer}.parquet").is_file())
