"""A small writer of OpenStreetMap's .pbf: plain nodes and tagged ways in one block each."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from pathlib import Path

from facade_core.core.arrays import Float64Array

_NANODEGREES = 100  # granularity


def write_pbf(path: Path, ways: Iterable[tuple[int, Float64Array, dict[str, str]]]) -> None:
    """Write ways of (id, (n, 2) longitude and latitude, tags)."""
    strings = [""]
    nodes, lines = b"", b""
    node = 0
    for id, places, tags in ways:
        is_closed = bool((places[0] == places[-1]).all())
        refs = []
        for longitude, latitude in (places[:-1] if is_closed else places).tolist():
            node += 1
            refs.append(node)
            found = [_signed(1, node)]
            found += [_signed(8, round(latitude * 1e7)), _signed(9, round(longitude * 1e7))]
            nodes += _bytes(1, b"".join(found))
        refs += refs[:1] if is_closed else []
        for text in (*tags, *tags.values()):
            if text not in strings:
                strings.append(text)
        steps = [refs[0], *(after - before for before, after in zip(refs, refs[1:], strict=False))]
        way = _number(1, id)
        way += _bytes(2, b"".join(_varint(strings.index(key)) for key in tags))
        way += _bytes(3, b"".join(_varint(strings.index(value)) for value in tags.values()))
        way += _bytes(8, b"".join(_varint(_zigzag(step)) for step in steps))
        lines += _bytes(3, way)
    table = _bytes(1, b"".join(_bytes(1, text.encode()) for text in strings))
    header = _bytes(4, b"OsmSchema-V0.6") + _bytes(16, b"benchmark")
    blocks = [table + _bytes(2, group) + _number(17, _NANODEGREES) for group in (nodes, lines)]
    path.write_bytes(_blob("OSMHeader", header) + b"".join(_blob("OSMData", block) for block in blocks))


def _blob(kind: str, content: bytes) -> bytes:
    blob = _number(2, len(content)) + _bytes(3, zlib.compress(content))
    header = _bytes(1, kind.encode()) + _number(3, len(blob))
    return struct.pack(">I", len(header)) + header + blob


def _varint(number: int) -> bytes:
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    return bytes([*out, number])


def _zigzag(number: int) -> int:
    return number << 1 if number >= 0 else (-number << 1) - 1


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _signed(field: int, value: int) -> bytes:
    return _number(field, _zigzag(value))


def _bytes(field: int, content: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(content)) + content
