"""What a client takes of a tileset: `python -m benchmarks.tiles TILESET_FOLDER ...` prints JSON; with `--of out/demo` it
exports that run first, as each of --textures, and tells the seconds.

Of all tiles together, coarse ones too, and of the finest: tiles, draw calls (primitives), bytes, textures on a graphics card
with their mipmaps, MB (sides that are no power of two are told as CesiumJS makes them, the next power of two; KTX2 a byte a
texel, others four), and the share of texels that triangles show. It reads any tileset of GLB files, of other versions too.

With `--detail`, of the run's own texels and what they would lose at half as many a metre: millions of walls, roofs and ground,
and the difference of grey (root mean square, of 255) of their charts halved and doubled again, which a tenth and half of the
texels stay below.
"""

from __future__ import annotations

import argparse
import io
import json
import struct
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from facade_core.export.models.glb import COMPONENT_DTYPES, read_glb_header
from facade_core.geometry.charts import ChartKind
from tasks.export.formats import export_run
from tasks.publish.published_run import open_published_run

MIPMAPS = 4 / 3


def measure(folder: Path) -> dict[str, Any]:
    """Of the tiles of an export."""
    files = sorted((folder / "tiles").glob("*.glb"))
    found = {file.name: _tile(file.read_bytes(), file.parent) for file in files}
    finest = {name: one for name, one in found.items() if name.startswith("full")}
    return {
        "all": _sum(found),
        "finest": _sum(finest),
        "largest_tile_mb": round(max(one["bytes"] for one in found.values()) / 1e6, 2),
    }


def _sum(tiles: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    total = {key: sum(one[key] for one in tiles.values()) for key in ("draws", "bytes", "texels", "used", "held")}
    return {
        "tiles": len(tiles),
        "draw_calls": total["draws"],
        "mb": round(total["bytes"] / 1e6, 1),
        "texture_mb": round(total["held"] / 1e6, 1),
        "texels_used": round(total["used"] / max(total["texels"], 1), 4),
    }


def _tile(glb: bytes, folder: Path) -> dict[str, float]:
    """Of one, whose pictures may lie beside its folder."""
    document, start = read_glb_header(io.BytesIO(glb))
    sizes, held = [], 0.0
    for image in document["images"]:
        if "uri" in image:
            data = (folder / image["uri"]).read_bytes()
        else:
            view = document["bufferViews"][image["bufferView"]]
            data = glb[start + view.get("byteOffset", 0) :][: view["byteLength"]]
        if image.get("mimeType") == "image/ktx2":
            size, texel = struct.unpack_from("<II", data, 20), 1
        else:
            size, texel = Image.open(io.BytesIO(data)).size, 4
        sizes.append(size)
        held += float(2 ** np.ceil(np.log2(size)).sum()) * texel * MIPMAPS

    def accessor(number: int) -> np.ndarray:
        one = document["accessors"][number]
        view = document["bufferViews"][one["bufferView"]]
        kind, width = np.dtype(COMPONENT_DTYPES[one["componentType"]]), {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[one["type"]]
        stride = view.get("byteStride", kind.itemsize * width)
        at = start + view.get("byteOffset", 0) + one.get("byteOffset", 0)
        values = np.ndarray((one["count"], width), kind, glb, at, (stride, kind.itemsize))
        return values / np.iinfo(kind).max if one.get("normalized") else values

    draws, used = 0, 0.0
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            draws += 1
            uv = accessor(primitive["attributes"]["TEXCOORD_0"]) * sizes[primitive["material"]]
            a, b, c = np.moveaxis(uv[accessor(primitive["indices"]).reshape(-1, 3)], 1, 0)
            u, v = b - a, c - a
            used += float(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2)
    texels = float(sum(width * height for width, height in sizes))
    return {"draws": draws, "bytes": len(glb), "texels": texels, "used": used, "held": held}


def detail(out: Path) -> dict[str, Any]:
    """Texels of a finished run by kind, and what they would lose if they were halved."""
    import cv2

    told = {}
    with open_published_run(out) as found:
        source = found.textured_mesh
        kinds = source.charts.kind
        for name, kind in (("walls", ChartKind.WALL), ("roofs", ChartKind.ROOF), ("ground", ChartKind.GROUND)):
            lost, texels = [], []
            for chart in np.unique(source.mesh.chart[kinds[source.mesh.chart] == kind]).tolist():
                grey = cv2.cvtColor(source.raster(chart), cv2.COLOR_RGB2GRAY)
                height, width = grey.shape
                half = cv2.resize(grey, (-(-width // 2), -(-height // 2)), interpolation=cv2.INTER_AREA)
                again = cv2.resize(half, (width, height), interpolation=cv2.INTER_LINEAR)
                lost.append(float(np.sqrt(((again.astype(float) - grey) ** 2).mean())))
                texels.append(width * height)
            order = np.argsort(lost)
            share = np.cumsum(np.array(texels)[order]) / sum(texels)
            tenth, middle = (lost[order[np.searchsorted(share, one)]] for one in (0.1, 0.5))
            told[name] = {"megatexels": round(sum(texels) / 1e6, 1), "lost": [round(tenth, 2), round(middle, 2)]}
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="*", type=Path, metavar="TILESET_FOLDER")
    parser.add_argument("--of", type=Path, metavar="RUN", help="a finished run, to be exported first")
    parser.add_argument("--textures", nargs="+", default=["jpeg", "webp", "ktx2"])
    parser.add_argument("--max-texture-mb", type=float, default=None)
    parser.add_argument(
        "--detail", action="store_true", help="with --of: what its texels would lose at half as many a metre"
    )
    arguments = parser.parse_args()
    if arguments.detail:
        print(json.dumps(detail(arguments.of), indent=1))
        return
    told = {str(folder): measure(folder) for folder in arguments.folders}
    with tempfile.TemporaryDirectory() as scratch:
        for textures in arguments.textures if arguments.of else ():
            start = time.monotonic()
            made = export_run(
                arguments.of,
                "3dtiles",
                Path(scratch) / textures,
                textures=textures,
                max_texture_mb=arguments.max_texture_mb,
            )
            told[textures] = measure(Path(str(made.path))) | {"seconds": round(time.monotonic() - start, 1)}
    print(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
