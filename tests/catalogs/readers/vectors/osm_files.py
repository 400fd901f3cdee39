"""Small OpenStreetMap extracts in .pbf, encoded field by field."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pyarrow

Packing = Literal["raw", "zlib", "lz4", "zstd"]
_BLOB_FIELDS = {"raw": 1, "zlib": 3, "lz4": 6, "zstd": 7}


@dataclass
class OsmFile:
    """Nodes by id, ways and relations; what a test leaves out of `nodes` is absent from the file."""

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    ways: dict[int, tuple[Sequence[int], Mapping[str, str]]] = field(default_factory=dict)
    relations: dict[int, tuple[Sequence[tuple[str, int]], Mapping[str, str]]] = field(default_factory=dict)

    def add_ring(self, way: int, box: tuple[float, float, float, float], tags: Mapping[str, str]) -> None:
        """Add a closed way around a box in metres from 24.9 E, 60.2 N; its nodes are numbered from 10 way."""
        x0, y0, x1, y1 = box
        corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
        self.nodes |= {10 * way + i: lonlat(*corner) for i, corner in enumerate(corners)}
        self.ways[way] = ([*range(10 * way, 10 * way + 4), 10 * way], tags)

    def write(
        self, path: Path, packing: Packing = "zlib", optional: Sequence[str] = (), required: Sequence[str] = ()
    ) -> Path:
        """Write the file."""
        header = b"".join(_text(4, name) for name in ("OsmSchema-V0.6", "DenseNodes", *required))
        header += b"".join(_text(5, name) for name in optional)
        path.write_bytes(_blob("OSMHeader", header, "zlib") + _blob("OSMData", self._block(), packing))
        return path

    def _block(self) -> bytes:
        words = [""]
        ids, places = list(self.nodes), list(self.nodes.values())
        dense = _packed(1, map(_zigzag, _deltas(ids)))
        for number, axis in ((8, 1), (9, 0)):
            dense += _packed(number, map(_zigzag, _deltas([round(place[axis] * 1e7) for place in places])))
        groups = [_part(2, dense)] if ids else []
        for number, element in ((3, self._ways(words)), (4, self._relations(words))):
            groups.append(b"".join(_part(number, one) for one in element))
        table = b"".join(_text(1, word) for word in words)
        return _part(1, table) + b"".join(_part(2, group) for group in groups if group)

    def _ways(self, words: list[str]) -> list[bytes]:
        return [
            _element(way, tags, words) + _packed(8, map(_zigzag, _deltas(list(nodes))))
            for way, (nodes, tags) in self.ways.items()
        ]

    def _relations(self, words: list[str]) -> list[bytes]:
        found = []
        for relation, (members, tags) in self.relations.items():
            roles = _packed(8, [_word(role, words) for role, _ in members])
            ids = _packed(9, map(_zigzag, _deltas([member for _, member in members])))
            found.append(_element(relation, tags, words) + roles + ids + _packed(10, [1] * len(members)))
        return found


def lonlat(x: float, y: float) -> tuple[float, float]:
    """Return the place at metres east and north of 24.9 E, 60.2 N, nearly."""
    return 24.9 + x / 55_400, 60.2 + y / 111_400


def _element(number: int, tags: Mapping[str, str], words: list[str]) -> bytes:
    keys, values = ([_word(text, words) for text in texts] for texts in (tags, tags.values()))
    return _varint(1 << 3) + _varint(number) + _packed(2, keys) + _packed(3, values)


def _word(text: str, words: list[str]) -> int:
    if text not in words:
        words.append(text)
    return words.index(text)


def _blob(kind: str, content: bytes, packing: Packing) -> bytes:
    packed = {
        "raw": lambda: content,
        "zlib": lambda: zlib.compress(content),
        "lz4": lambda: pyarrow.Codec("lz4_raw").compress(content, asbytes=True),
        "zstd": lambda: pyarrow.Codec("zstd").compress(content, asbytes=True),
    }[packing]()
    size = b"" if packing == "raw" else _varint(2 << 3) + _varint(len(content))
    blob = size + _part(_BLOB_FIELDS[packing], packed)
    header = _text(1, kind) + _varint(3 << 3) + _varint(len(blob))
    return struct.pack("!L", len(header)) + header + blob


def _deltas(values: Sequence[int]) -> list[int]:
    return [value - before for before, value in zip([0, *values[:-1]], values, strict=True)] if values else []


def _zigzag(value: int) -> int:
    return value * 2 if value >= 0 else -value * 2 - 1


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 127:
        found.append(value & 127 | 128)
        value >>= 7
    return bytes([*found, value])


def _part(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _text(number: int, text: str) -> bytes:
    return _part(number, text.encode())


def _packed(number: int, values: Iterable[int]) -> bytes:
    return _part(number, b"".join(map(_varint, values)))
