"""The kinds of units in the order in which a run does them. A new stage is a module of this room, one of `tasks/units`, and an
entry here."""

from __future__ import annotations

from tasks.kinds.exemplars import EXEMPLARS
from tasks.kinds.facades import FACADES
from tasks.kinds.kind import Kind
from tasks.kinds.poses import POSES
from tasks.kinds.streets import STREETS, VIEWPOINTS
from tasks.kinds.textures import TEXTURES

KINDS: tuple[Kind, ...] = (POSES, EXEMPLARS, TEXTURES, FACADES, VIEWPOINTS, STREETS)
STAGES = tuple(kind.stage for kind in KINDS)
# The stages that have code of their own, those before and after the units among them.
CODED = ("ingest", *(kind.stage for kind in KINDS if kind.part_of is None), "publish")
