"""Cameras, charts, streets and visibility. Conventions: geometry/README.md."""

from facade_core.geometry.charts import GROUND, KINDS, ROOF, WALL, Charts, Mesh
from facade_core.geometry.equirectangular import directions, project
from facade_core.geometry.packing import Placement, pack
from facade_core.geometry.streets import Viewpoint, colour_waves, viewpoints
from facade_core.geometry.surfaces import block_surfaces

__all__ = [
    "GROUND",
    "KINDS",
    "ROOF",
    "WALL",
    "Charts",
    "Mesh",
    "Placement",
    "Viewpoint",
    "block_surfaces",
    "colour_waves",
    "directions",
    "pack",
    "project",
    "viewpoints",
]
