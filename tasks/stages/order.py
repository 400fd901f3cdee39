"""The stages in the order of a run. A new stage is a folder beside this module and an entry here."""

from __future__ import annotations

from tasks.engine.stage import Stage
from tasks.stages.bundles.stage import BUNDLES
from tasks.stages.exemplars.stage import EXEMPLARS
from tasks.stages.facades.stage import FACADES
from tasks.stages.grounds.stage import GROUNDS
from tasks.stages.pages.stage import PAGES
from tasks.stages.pictures.stage import PICTURES
from tasks.stages.poses.stage import POSES
from tasks.stages.streets.stage import STREETS
from tasks.stages.surfaces.stage import SURFACES
from tasks.stages.textures.stage import TEXTURES
from tasks.stages.tiles.stage import TILES
from tasks.stages.walls.stage import WALLS

__all__ = [
    "BUNDLES",
    "CODE_STAGES",
    "EXEMPLARS",
    "FACADES",
    "GROUNDS",
    "PAGES",
    "PICTURES",
    "POSES",
    "STAGES_IN_ORDER",
    "STAGE_NAMES",
    "STREETS",
    "SURFACES",
    "TEXTURES",
    "TILES",
    "WALLS",
]

# After the ingest, and before publication.
STAGES_IN_ORDER: tuple[Stage, ...] = (
    # where panoramas were taken: refined alone, then together
    POSES,
    BUNDLES,
    # exemplars: parsed and completed
    EXEMPLARS,
    # base layer: textures of the model, ground and walls from panoramas
    TEXTURES,
    GROUNDS,
    WALLS,
    # facades: rectified, parsed, completed, inpainted, encoded, or made from an exemplar; written to the base layer
    FACADES,
    # streets: what pictures show of the ground is continued viewpoint by viewpoint
    STREETS,
    # texels that nothing has textured yet, and seams between charts
    SURFACES,
    # what is published: pages, tiles, pictures
    PAGES,
    TILES,
    PICTURES,
)
STAGE_NAMES = tuple(stage.stage for stage in STAGES_IN_ORDER)
# Stages with code of their own, with those before and after the units.
CODE_STAGES = ("ingest", *STAGE_NAMES, "publish")
