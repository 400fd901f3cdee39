"""OpenStreetMap extracts in .pbf: their blobs, and the incomplete features at their border.

Field numbers are those of the PBF format of the OSM wiki.
"""

from __future__ import annotations

import struct
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import numpy as np
from shapely import MultiPoint

from catalogs.reader_errors import wrap_reader_errors
from facade_core.core.arrays import BoolArray, Float64Array, IntArray
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from pyrosm.proto.fileformat_pb2 import BlobHeader

# Compressions of blobs that pyrosm does not read, by their field, as Arrow names them.
_CODECS = {6: "lz4_raw", 7: "zstd"}
_MAX_BLOB_BYTES = 32 * 2**20
_WAY_MEMBER = 1
_PACKING_REMEDY = "download it again, or write it again with osmium cat -f pbf"
_SMART_REMEDY = "cut it out again with osmium extract -s smart"
_FILTER_REMEDY = "filter it again with osmium tags-filter without --omit-referenced"
_LOCATIONS_REMEDY = "write it again with osmium add-locations-to-ways --keep-untagged-nodes"


class IncompleteFeature(NamedTuple):
    """Way or relation with absent nodes or ways, and its present nodes."""

    tags: Mapping[str, str]
    places: MultiPoint | None


class IncompleteFeatures(NamedTuple):
    """Incomplete features of an extract by id, and the remedy."""

    features: Mapping[str, IncompleteFeature]
    remedy: str


@contextmanager
def open_osm_extract(path: Path) -> Iterator[str]:
    """Yield the path by which pyrosm reads an extract: blobs in lz4 or zstd are unpacked into a temporary file.

    Raises
    ------
    InputError
        Where the file is no readable .pbf.
    """
    with (
        open_regular(path) as file,
        warnings.catch_warnings(),
        wrap_reader_errors(path, "cannot be read as OSM .pbf", _PACKING_REMEDY),
    ):
        warnings.simplefilter("ignore", UserWarning)  # of layers without features
        if b"OSMHeader" not in file.read(64):
            raise InputError(f"{path} is not an OSM .pbf file; export the area again as .osm.pbf")
        if not any(_packed_content(blob) for _, blob in _iterate_blobs(file)):
            yield str(path)
            return
        with tempfile.NamedTemporaryFile(suffix=".osm.pbf") as unpacked:
            for header, blob in _iterate_blobs(file):
                content = _unpack_blob(blob)
                header.datasize = len(content)
                start = header.SerializeToString()
                unpacked.write(struct.pack("!L", len(start)) + start + content)
            unpacked.flush()
            yield unpacked.name


def find_incomplete_features(path: Path, readable: str) -> IncompleteFeatures:
    """Find the tagged ways and relations with absent nodes or ways.

    Parameters
    ----------
    path : file as the user names it.
    readable : path by which pyrosm reads it.

    Raises
    ------
    InputError
        Where it lacks nodes of every way.
    """
    from pyrosm.pbf_export import read_header_block
    from pyrosm.pbfreader import iter_decoded_blocks

    header = read_header_block(readable)
    if "HistoricalInformation" in header.required_features:
        raise InputError(f"{path} holds all versions of its features; take those of one day with osmium time-filter")
    blocks = list(iter_decoded_blocks(readable))
    node_ids, lonlat = _locate_nodes([(header, nodes) for _, header, nodes, _, _ in blocks if nodes is not None])
    ways = [_Rows(strings, found, "refs") for strings, _, _, found, _ in blocks if found is not None]
    relations = [_Rows(strings, found, "members") for strings, _, _, _, found in blocks if found is not None]
    cut = [rows.find_rows(~_are_in(rows.members, node_ids)) for rows in ways]
    whole = np.sort(
        np.concatenate([np.zeros(0, np.int64), *(np.delete(w.ids, c) for w, c in zip(ways, cut, strict=True))])
    )
    has_locations = "LocationsOnWays" in header.optional_features
    if not len(whole) and any(map(len, cut)):
        remedy = _LOCATIONS_REMEDY if has_locations else _FILTER_REMEDY
        raise InputError(f"{path} lacks the nodes of its ways; {remedy}")
    lacking = [rows.find_rows(rows.are_ways & ~_are_in(rows.members, whole)) for rows in relations]
    wanted = [rows.list_members(row) for rows, found in zip(relations, lacking, strict=True) for row in found]
    shown = np.sort(np.concatenate([np.zeros(0, np.int64), *wanted]))
    places = {
        int(rows.ids[row]): _locate_members(rows.list_members(row), node_ids, lonlat)
        for rows, found in zip(ways, cut, strict=True)
        for row in {*found, *np.flatnonzero(_are_in(rows.ids, shown)).tolist()}
    }
    incomplete = _describe_features("w", ways, cut, places) | _describe_features("r", relations, lacking, places)
    return IncompleteFeatures(incomplete, _LOCATIONS_REMEDY if has_locations else _SMART_REMEDY)


def _describe_features(
    letter: str, tables: list[_Rows], chosen: list[list[int]], places: Mapping[int, Float64Array]
) -> dict[str, IncompleteFeature]:
    """Return the chosen rows that have tags, by id.

    Parameters
    ----------
    letter : "w" for ways, "r" for relations.
    places : longitudes and latitudes (n, 2) of ways by id.
    """
    features = {}
    for rows, found in zip(tables, chosen, strict=True):
        for row in found:
            if not (tags := rows.tags(row)):
                continue
            members = [int(rows.ids[row])] if letter == "w" else rows.list_members(row).tolist()
            points = np.concatenate([np.zeros((0, 2)), *(places[way] for way in members if way in places)])
            features[f"{letter}{rows.ids[row]}"] = IncompleteFeature(tags, MultiPoint(points) if len(points) else None)
    return features


class _Rows:
    """Ways or relations of a block: the members of a row are those between two offsets."""

    def __init__(self, strings: list[str], columns: Mapping[str, IntArray], kind: str) -> None:
        self.ids, self.members = columns["id"], columns["refs" if kind == "refs" else "memids"]
        self.are_ways = columns["types"] == _WAY_MEMBER if "types" in columns else np.ones(len(self.members), bool)
        self._strings, self._columns, self._offsets = strings, columns, columns[f"{kind}_off"]

    def find_rows(self, mask: BoolArray) -> list[int]:
        """Find the rows with a marked member."""
        counts = np.concatenate([[0], np.cumsum(mask)])
        return [int(row) for row in np.flatnonzero(np.diff(counts[self._offsets]))]

    def list_members(self, row: int) -> IntArray:
        """Return the ways or nodes of a row."""
        span = slice(self._offsets[row], self._offsets[row + 1])
        members: IntArray = self.members[span][self.are_ways[span]]
        return members

    def tags(self, row: int) -> dict[str, str]:
        span = slice(self._columns["tags_off"][row], self._columns["tags_off"][row + 1])
        pairs = zip(self._columns["keys"][span], self._columns["vals"][span], strict=True)
        return {self._strings[key]: self._strings[value] for key, value in pairs}


def _locate_nodes(blocks: list[tuple[Mapping[str, int], Mapping[str, IntArray]]]) -> tuple[IntArray, Float64Array]:
    """Return ids (n,) in their order, and longitudes and latitudes (n, 2), of the nodes."""
    ids = np.concatenate([np.zeros(0, np.int64), *(nodes["id"] for _, nodes in blocks)])
    degrees = [
        np.column_stack([nodes[key] * header["granularity"] + header[f"{key}_offset"] for key in ("lon", "lat")]) / 1e9
        for header, nodes in blocks
    ]
    order = np.argsort(ids)
    return ids[order], np.concatenate([np.zeros((0, 2)), *degrees])[order]


def _are_in(ids: IntArray, known: IntArray) -> BoolArray:
    """Return which ids (n,) are among known ones (k,), ascending."""
    if not len(known):
        return np.zeros(len(ids), bool)
    found: BoolArray = known[np.minimum(np.searchsorted(known, ids), len(known) - 1)] == ids
    return found


def _locate_members(wanted: IntArray, ids: IntArray, lonlat: Float64Array) -> Float64Array:
    """Return longitudes and latitudes (n, 2) of the nodes that are there."""
    rows = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
    places: Float64Array = lonlat[rows[ids[rows] == wanted]] if len(ids) else lonlat
    return places


def _iterate_blobs(file: IO[bytes]) -> Iterator[tuple[BlobHeader, bytes]]:
    from pyrosm.proto.fileformat_pb2 import BlobHeader

    file.seek(0)
    while len(size := file.read(4)) == 4:
        header = BlobHeader.FromString(file.read(struct.unpack("!L", size)[0]))
        yield header, file.read(header.datasize)


def _packed_content(blob: bytes) -> tuple[str, bytes, int] | None:
    """Return codec, content and unpacked size of a blob that pyrosm does not read; None for others."""
    from google.protobuf.unknown_fields import UnknownFieldSet
    from pyrosm.proto.fileformat_pb2 import Blob

    parsed = Blob.FromString(blob)
    for field in UnknownFieldSet(parsed):
        if field.field_number in _CODECS:
            return _CODECS[field.field_number], field.data, parsed.raw_size
    return None


def _unpack_blob(blob: bytes) -> bytes:
    """Return a blob with its content as it is, not packed."""
    from pyarrow import Codec
    from pyrosm.proto.fileformat_pb2 import Blob

    packed = _packed_content(blob)
    if packed is None:
        return blob
    codec, content, size = packed
    if not 0 < size <= _MAX_BLOB_BYTES:
        raise ValueError("a blob states no size, or one of over 32 MiB")
    unpacked: bytes = Blob(raw=Codec(codec).decompress(content, size, asbytes=True)).SerializeToString()
    return unpacked
