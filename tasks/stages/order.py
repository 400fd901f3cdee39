"""The kinds of units in the order in which a run does them. A new stage is a module of this room, one of `tasks/units`, and an
entry here."""

from __future__ import annotations

from facade_core.atlas.journal import read_journal
from facade_core.core.zarr_types import StoreGroup
from tasks.engine.stage import Records, Stage
from tasks.stages.bundles.stage import BUNDLES
from tasks.stages.exemplars.stage import EXEMPLARS
from tasks.stages.facades.stage import FACADES
from tasks.stages.grounds.stage import GROUNDS
from tasks.stages.pages.stage import PAGES
from tasks.stages.pictures.stage import PICTURES
from tasks.stages.poses.stage import POSES
from tasks.stages.streets.stage import STREETS, VIEWPOINTS
from tasks.stages.surfaces.stage import SURFACES
from tasks.stages.textures.stage import TEXTURES
from tasks.stages.tiles.stage import TILES
from tasks.stages.walls.stage import WALLS

KINDS: tuple[Stage, ...] = (
    POSES,
    BUNDLES,
    EXEMPLARS,
    TEXTURES,
    GROUNDS,
    WALLS,
    FACADES,
    VIEWPOINTS,
    STREETS,
    SURFACES,
    PAGES,
    TILES,
    PICTURES,
)
STAGES = tuple(kind.stage for kind in KINDS)
# The stages that have code of their own, those before and after the units among them.
CODED = ("ingest", *(kind.stage for kind in KINDS if kind.part_of is None), "publish")


def read_journals(group: StoreGroup) -> dict[str, Records]:
    """The records of every stage by unit index, None where there is none."""
    return {stage: read_journal(group, stage) for stage in STAGES}
