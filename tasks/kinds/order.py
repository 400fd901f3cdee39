"""The kinds of units in the order in which a run does them. A new stage is a module of this room, one of `tasks/units`, and an
entry here."""

from __future__ import annotations

from facade_core.atlas.journal import read_journal
from facade_core.core.zarr_types import StoreGroup
from tasks.kinds.bundles import BUNDLES
from tasks.kinds.exemplars import EXEMPLARS
from tasks.kinds.facades import FACADES
from tasks.kinds.grounds import GROUNDS
from tasks.kinds.kind import Records, Stage
from tasks.kinds.pages import PAGES
from tasks.kinds.pictures import PICTURES
from tasks.kinds.poses import POSES
from tasks.kinds.streets import STREETS, VIEWPOINTS
from tasks.kinds.surfaces import SURFACES
from tasks.kinds.textures import TEXTURES
from tasks.kinds.tiles import TILES
from tasks.kinds.walls import WALLS

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
