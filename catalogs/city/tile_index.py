"""Index of tiles as the source of a city: STAC, or outlines with paths in a table.

Tables are GeoParquet, GeoPackage or GeoJSON. Paths are relative to the file that states them. Nothing is downloaded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlparse

from catalogs.crs import LONLAT
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers import gdal_files
from catalogs.readers.json_text import load_json, parse_json
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import MAX_TEXT_BYTES, read_regular

if TYPE_CHECKING:
    import pystac
    from geopandas import GeoDataFrame

# Columns that name a tile's file, the first present is used; gdaltindex writes `location`.
LOCATION_COLUMNS = ("location", "href", "path", "url", "file")
LonLatBox = tuple[float, float, float, float]


def tile_files_in_area(index: Path, area: Sequence[float] | None) -> list[Path]:
    """Return the files of an index's tiles that meet an area, sorted.

    Parameters
    ----------
    area : (west, south, east, north) in degrees; None for all tiles.

    Raises
    ------
    InputError : one line with the remedy, if the index cannot be read, names no tile there, or names a missing file.
    """
    if not index.is_file():
        raise InputError(f"{index} does not exist; paths are relative to the city file")
    tiles = list(_stac_tiles(index) if _is_stac(index) else _table_tiles(index))
    if not tiles:
        raise InputError(f"{index} names no tile; give one that does")
    chosen = sorted({file for file, box in tiles if area is None or box is None or _boxes_intersect(box, area)})
    if not chosen:
        west, south, east, north = zip(*(box for _, box in tiles if box is not None), strict=True)
        bounds = " ".join(f"{value:.6g}" for value in (min(west), min(south), max(east), max(north)))
        wanted = " ".join(f"{value:.6g}" for value in area or ())
        raise InputError(
            f"{index}: none of its {len(tiles)} tiles meets {wanted}; they lie within {bounds}, choose there"
        )
    if missing := [file for file in chosen if not file.is_file()]:
        more = f", nor are {len(missing) - 1} more" if len(missing) > 1 else ""
        raise InputError(f"{index}: its tile {missing[0]} is not there{more}; bring the tiles to where it names them")
    return chosen


def _boxes_intersect(box: LonLatBox, area: Sequence[float]) -> bool:
    return box[0] <= area[2] and box[2] >= area[0] and box[1] <= area[3] and box[3] >= area[1]


def _is_stac(index: Path) -> bool:
    if index.suffix.lower() != ".json":
        return False
    content = load_json(index, MAX_TEXT_BYTES)
    return isinstance(content, dict) and (
        "stac_version" in content or any("stac_version" in feature for feature in _feature_list(content))
    )


def _feature_list(content: JsonObject) -> list[JsonObject]:
    found = content.get("features")
    return [feature for feature in found if isinstance(feature, dict)] if isinstance(found, list) else []


def _stac_tiles(index: Path) -> Iterator[tuple[Path, LonLatBox | None]]:
    """Read the tiles of a STAC catalogue, collection, item or item collection."""
    import pystac
    from pystac.stac_io import DefaultStacIO

    class OnThisMachine(DefaultStacIO):
        def read_text_from_href(self, href: str) -> str:
            path = _local_path(href, index.parent)
            parse_json(text := read_regular(path), str(path))  # pystac's own parser ends where a text nests too deep
            return text.decode("utf-8-sig")

    reader = OnThisMachine()
    with wrap_reader_errors(index, "cannot be read as STAC", "mend it"):
        content = load_json(index, MAX_TEXT_BYTES)
        if isinstance(content, dict) and "features" in content:
            items = list(pystac.ItemCollection.from_file(str(index), stac_io=reader))
        else:
            root = pystac.read_file(str(index), stac_io=reader)
            assert isinstance(root, pystac.Catalog | pystac.Item)
            items = list(root.get_items(recursive=True)) if isinstance(root, pystac.Catalog) else [root]
    for item in items:
        href = _data_asset(item, index).get_absolute_href() or _data_asset(item, index).href
        box = tuple(item.bbox) if item.bbox else None
        yield _local_path(href, index.parent), None if box is None else _drop_heights(box)


def _drop_heights(box: tuple[float, ...]) -> LonLatBox:
    """Return a box without heights."""
    half = len(box) // 2
    return box[0], box[1], box[half], box[half + 1]


def _data_asset(item: pystac.Item, index: Path) -> pystac.Asset:
    """Return the asset with the role `data`, or else the only asset."""
    assets = list(item.assets.values())
    data = [asset for asset in assets if "data" in (asset.roles or ())] or assets
    if len(data) != 1:
        raise InputError(f"{index}: item {item.id} has {len(data)} assets that may be its tile; give one the role data")
    return data[0]


def _table_tiles(index: Path) -> Iterator[tuple[Path, LonLatBox | None]]:
    """Read the tiles of a table of outlines."""
    import geopandas as gpd

    with wrap_reader_errors(index, "cannot be read as an index of tiles", "give STAC or GeoParquet"):
        parquet = index.suffix.lower() in (".parquet", ".geoparquet")
        table = gpd.read_parquet(index) if parquet else _read_outlines(index)
    column = next((name for name in LOCATION_COLUMNS if name in table.columns), None)
    if column is None:
        raise InputError(f"{index} has no column that names the tiles' files; call it {LOCATION_COLUMNS[0]}")
    if table.crs is None:
        raise InputError(f"{index} states no frame; write it with one, such as {LONLAT}")
    boxes = table.to_crs(LONLAT).bounds.to_numpy().tolist()
    for place, box in zip(table[column].astype(str), boxes, strict=True):
        yield _local_path(place, index.parent), (box[0], box[1], box[2], box[3])


def _read_outlines(index: Path) -> GeoDataFrame:
    """Read the first layer with geometry."""
    layer = next((name for name, geometry in gdal_files.list_layers(index) if geometry is not None), None)
    if layer is None:
        raise InputError(f"{index} has no layer of outlines; give STAC or GeoParquet")
    return gdal_files.read_dataframe(index, layer=layer)


def _local_path(href: str, folder: Path) -> Path:
    """Return the file that a link names. Raises InputError for a link to another machine."""
    url = urlparse(href)
    if url.scheme in ("", "file"):
        return (folder / (unquote(url.path) if url.scheme else href)).resolve()
    raise InputError(f"tile {href[:120]} is not on this machine; bring it here and name the copy")
