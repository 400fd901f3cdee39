"""Cameras, charts, streets and visibility. Conventions: geometry/README.md."""

from facade_core.geometry.charts import CEILING, DOOR, GROUND, KINDS, METAL, ROOF, WALL, WINDOW, Charts, Mesh
from facade_core.geometry.equirectangular import directions, project
from facade_core.geometry.packing import Placement, pack
from facade_core.geometry.streets import Viewpoint, colour_waves, viewpoints
from facade_core.geometry.surfaces import block_surfaces
from facade_core.geometry.terrain import Terrain, terrain_of

__all__ = [
    "CEILING",
    "DOOR",
    "GROUND",
    "KINDS",
    "METAL",
    "ROOF",
    "WALL",
    "WINDOW",
    "Charts",
    "Mesh",
    "Placement",
    "Terrain",
    "Viewpoint",
    "block_surfaces",
    "colour_waves",
    "directions",
    "pack",
    "project",
    "terrain_of",
    "viewpoints",
]
