"""Small files that claim, or unpack to, more than a machine should be asked for; written by name, and read on their own."""

from __future__ import annotations

import gzip
import json
import resource
import signal
import sqlite3
import struct
import sys
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import geometry_files as sound
import numpy as np

ROOM = 2**30  # bytes of address space that reading one may take
MB = 2**20


def zeros(path: Path) -> None:
    """100 MB of triangles in 0.1 MB."""
    np.savez_compressed(
        path, triangles=np.zeros((100 * MB // 36, 3, 3), np.float32), feature=np.zeros(300 * MB // 36, np.uint8)
    )


def shape(path: Path, claimed: str) -> None:
    """An array whose header claims a shape."""
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {claimed}, }}".ljust(117) + "\n"
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + b"\0" * 64
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("triangles.npy", array)
        archive.writestr("feature.npy", array)


def xml(path: Path, inside: bytes, times: int) -> None:
    """A CityGML that repeats something."""
    head = b"<CityModel xmlns='http://www.opengis.net/citygml/2.0' xmlns:gml='http://www.opengis.net/gml'>"

    def parts() -> Iterator[bytes]:
        yield head
        for _ in range(16):
            yield inside * (times // 16)
        yield b"</CityModel>"

    with gzip.GzipFile(path, "wb", 1, mtime=0) if path.suffix == ".gz" else path.open("wb") as file:
        for part in parts():
            file.write(part)


def gltf(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    sound.gltf(path)
    header = json.loads(path.read_text())
    change(header)
    path.write_text(json.dumps(header))


def _no_view(header: dict[str, Any]) -> None:
    header["accessors"][0] |= {"count": 10**9}
    del header["accessors"][0]["bufferView"]


def _sparse(header: dict[str, Any]) -> None:
    _no_view(header)
    header["accessors"][0] |= {"count": 3 * 10**7}


def _count(header: dict[str, Any]) -> None:
    header["accessors"][0] |= {"count": 10**9}


def _many(header: dict[str, Any]) -> None:
    header["nodes"] += [{"name": str(i), "mesh": 0} for i in range(60_000)]
    header["scenes"][0]["nodes"] = list(range(len(header["nodes"])))


def _circle(header: dict[str, Any]) -> None:
    header["nodes"][0]["children"] = [1]
    header["nodes"][1]["children"] = [0]


def _twice(header: dict[str, Any]) -> None:
    first = len(header["nodes"])
    header["nodes"] += [{"name": f"n{i}", "children": [first + i + 1, first + i + 1]} for i in range(40)] + [
        {"mesh": 0}
    ]
    header["scenes"][0]["nodes"] = [first]


def _buffer(header: dict[str, Any]) -> None:
    header["buffers"][0] = {"byteLength": 10**10, "uri": "/dev/zero"}


def ply(path: Path, form: str, count: int) -> None:
    lines = [
        "ply", f"format {form} 1.0", f"element vertex {count}", "property float x", "property float y", "property float z",
        f"element face {count}", "property list uchar int vertex_indices", "end_header", "",
    ]  # fmt: skip
    path.write_bytes("\n".join(lines).encode() + b"\0" * 120)


def parquet(path: Path, name: str, values: Any) -> None:
    """A column of one value six million times, or of one long text many times, packed to almost nothing."""
    import pyarrow as pa
    from pyarrow import parquet as pq

    sound.vectors(sound.outlines, path)
    table = pq.read_table(path)
    rows = len(values)
    columns = {key: pa.nulls(rows, table[key].type) for key in table.column_names} | {name: values}
    fields = [pa.field(key, column.type) for key, column in columns.items()]
    made = pa.table(list(columns.values()), schema=pa.schema(fields, metadata=table.schema.metadata))
    pq.write_table(made, path, compression="zstd", row_group_size=rows)


def nulls(path: Path) -> None:
    import pyarrow as pa

    parquet(path, "height", pa.nulls(6_000_000, pa.float64()))


def texts(path: Path) -> None:
    import pyarrow as pa

    parquet(
        path, "name", pa.DictionaryArray.from_arrays(pa.array(np.zeros(20_000, np.int8)), pa.array(["x" * 100_000]))
    )


def fgb(path: Path, count: int) -> None:
    """What the header says of the number of features is exchanged."""
    sound.vectors(sound.outlines, path)
    data = bytearray(path.read_bytes())
    place = data.index(struct.pack("<Q", 2), 12)
    data[place : place + 8] = struct.pack("<Q", count)
    path.write_bytes(data)


def pbf(path: Path, claimed: int | None) -> None:
    """A block that unpacks to 100 MB, claimed or not."""
    sound.pbf(path)
    with path.open("ab") as file:
        file.write(sound.blob(b"OSMData", b"\0" * (100 * MB), claimed))


def view(path: Path, name: str) -> None:
    """A layer, or one of the package's own tables, exchanged for a view that never ends."""
    sound.vectors(sound.outlines, path)
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"
    with closing(sqlite3.connect(path)) as file:
        columns = [row[1] for row in file.execute(f"PRAGMA table_info({name})")]
        file.execute("PRAGMA legacy_alter_table = ON")
        triggers = file.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for (trigger,) in triggers:
            file.execute(f'DROP TRIGGER "{trigger}"')
        file.execute(f"ALTER TABLE {name} RENAME TO behind")
        shown = ", ".join(f'behind."{column}"' for column in columns)
        file.execute(f"CREATE VIEW {name} AS {endless} {shown} FROM behind, n")
        file.commit()


def shp(path: Path) -> None:
    sound.vectors(sound.outlines, path)
    index, table = path.with_suffix(".shx"), path.with_suffix(".dbf")
    data = bytearray(index.read_bytes())
    data[24:28] = struct.pack(">i", 2**30)
    index.write_bytes(data)
    data = bytearray(table.read_bytes())
    data[4:8] = struct.pack("<I", 2**31)
    table.write_bytes(data)


def nested(path: Path) -> None:
    deep = "[" * 200_000 + "]" * 200_000
    path.write_text(f'{{"type": "FeatureCollection", "features": {deep}}}')


def graphml(path: Path) -> None:
    sound.graphml(path)
    entities = "".join(f"<!ENTITY e{i} '{f'&e{i - 1};' * 10 if i else 'x' * 10}'>" for i in range(12))
    text = path.read_text().replace("<graphml", f"<!DOCTYPE g [{entities}]><graphml", 1).replace(">N0<", ">&e11;<")
    path.write_text(text)


def gml_entities(path: Path) -> None:
    sound.citygml(path)
    entities = "".join(f"<!ENTITY e{i} '{f'&e{i - 1};' * 10 if i else 'x' * 10}'>" for i in range(12))
    path.write_text(f"<!DOCTYPE g [{entities}]>" + path.read_text().replace("EPSG:32635", "&e11;"))


BOMBS: Mapping[str, Callable[[Path], None]] = {
    "zeros.npz": zeros,
    "shape40GB.npz": lambda path: shape(path, "(550000000, 3, 3)"),
    "shape-huge.npz": lambda path: shape(path, "(999999999999, 3, 3)"),
    "shape-negative.npz": lambda path: shape(path, "(-1, 3, 3)"),
    "shape-deep.npz": lambda path: shape(path, "(" * 100 + "1" + ")" * 100),
    "blanks.gml.gz": lambda path: xml(path, b" ", 64 * MB),
    "tags.gml.gz": lambda path: xml(path, b"<a/>", 5 * MB),
    "members.gml.gz": lambda path: xml(path, b"<cityObjectMember>" + b" " * 100 + b"</cityObjectMember>", MB // 2),
    "text.gml.gz": lambda path: xml(path, b"1 ", 32 * MB),
    "deep.gml": lambda path: xml(path, b"<a>", 3 * MB),
    "entities.gml": gml_entities,
    "noview.gltf": lambda path: gltf(path, _no_view),
    "zeros.gltf": lambda path: gltf(path, _sparse),
    "count.gltf": lambda path: gltf(path, _count),
    "many.gltf": lambda path: gltf(path, _many),
    "circle.gltf": lambda path: gltf(path, _circle),
    "twice.gltf": lambda path: gltf(path, _twice),
    "device.gltf": lambda path: gltf(path, _buffer),
    "binary.ply": lambda path: ply(path, "binary_little_endian", 2 * 10**9),
    "ascii.ply": lambda path: ply(path, "ascii", 2 * 10**9),
    "nulls.parquet": nulls,
    "texts.parquet": texts,
    "count.fgb": lambda path: fgb(path, 2**40),
    "unpacks.osm.pbf": lambda path: pbf(path, None),
    "lies.osm.pbf": lambda path: pbf(path, 1000),
    "endless.gpkg": lambda path: view(path, "endless"),
    "contents.gpkg": lambda path: view(path, "gpkg_contents"),
    "columns.gpkg": lambda path: view(path, "gpkg_geometry_columns"),
    "count.shp": shp,
    "nested.geojson": nested,
    "nested.city.json": nested,
    "entities.graphml": graphml,
}


def main(folder: Path, names: list[str]) -> None:
    """Write and read each, one line for each that takes more than ROOM, 20 s, or ends in another exception."""
    from catalogs.readers.formats import read_buildings, read_centrelines
    from facade_core.core.errors import InputError

    warnings.simplefilter("ignore")
    limit = resource.getrlimit(resource.RLIMIT_AS)
    for name in names:
        BOMBS[name](folder / name)
        now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + ROOM, limit[1]))
        signal.alarm(20)
        print(name, end=" ", flush=True)
        try:
            (read_centrelines if name.endswith("graphml") else read_buildings)(folder / name)
            print("read")
        except InputError as error:
            print("refused" if "than memory can" not in str(error) else "TOO LARGE", error)
        except BaseException as error:  # that is what is looked for
            print("WRONG", type(error).__name__, str(error)[:200])
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, limit)
        (folder / name).unlink()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:] or list(BOMBS))
