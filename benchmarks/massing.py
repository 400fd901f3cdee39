"""What stands out of roofs costs in charts, triangles and texels: `python -m benchmarks.massing BLOCK.yaml` prints JSON.

The geometry of a block with eaves, parapets, chimneys, dormers, rooflights, gutters and vents, without the last two, and
without any, each packed into an atlas of DENSITY texels a metre everywhere; nothing is textured.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from catalogs.block.reader import Block, read_block
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import MappedGround
from facade_core.geometry import block_surfaces as surfaces
from facade_core.geometry.buildings.eaves import Overhang
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.carriageways import fit_ground_between_buildings
from facade_core.geometry.ground.terrain import build_terrain

DENSITY = 16.0


def measure(block: Block) -> dict[str, Any]:
    """Counts of charts, triangles, texels and chunks; and how far roofs leave the planes of their charts at most, metres."""
    spec = AtlasSpec(1, DENSITY)
    ground = fit_ground_between_buildings(
        block.ground or MappedGround(), block.streets, [building.footprint for building in block.buildings]
    )
    charts, mesh, _ = surfaces.build_block_surfaces(
        block.buildings,
        block.streets,
        terrain=build_terrain(block.buildings, block.terrain),
        ground_margin=block.texture.visibility_range,
        largest=spec.max_chart_side,
        within=ground.outline,
    )
    texels = charts.texels(DENSITY)
    placement = pack_charts(charts.size, DENSITY, charts.building, page=spec.page, chunk=spec.chunk, gutter=spec.gutter)
    chunks = [placement.chunks(chart, spec.chunk, spec.gutter) for chart in range(len(charts))]
    own = mesh.vertex_chart
    off = np.abs(np.einsum("ij,ij->i", mesh.vertices - charts.origin[own], charts.normals()[own]))
    return {
        "charts": len(charts),
        "triangles": len(mesh.triangles),
        "megatexels": round(float(texels.prod(axis=1).sum()) / 1e6, 2),
        "chunks": len(np.unique(np.concatenate(chunks), axis=0)),
        "roofs_off_plane": round(float(off[charts.kind[own] == ChartKind.ROOF].max(initial=0.0)), 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("block", type=Path, help="a block file, such as out/demo/input/helsinki.yaml")
    block = read_block(parser.parse_args().block)
    fittings: dict[str, Any] = {name: lambda *_: None for name in ("gutters", "vents", "vents_on_flat")}
    bare: dict[str, Any] = {
        "overhang": lambda roof, *_: Overhang(roof, None, [], [], 0.0),
        "parapet": lambda *_: None,
        "chimneys": lambda *_: None,
        "dormers": lambda *_: None,
        **fittings,
    }
    found = {}
    for name, left_out in (("without", bare), ("without_fittings", fittings)):
        with patch.multiple(surfaces, **left_out):
            found[name] = measure(block)
    found["with"] = measure(block)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
