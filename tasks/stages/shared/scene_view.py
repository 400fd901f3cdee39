"""References to large inputs of units: parts of the block, and earlier results in the store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.scene import Scene
from facade_core.plan.plan import Plan
from tasks.engine.context import current_store, load_run_plan
from tasks.engine.run import Run


@dataclass(frozen=True)
class SceneView:
    """Part of the block that a unit sees: some charts, and the objects that may hide or surround them.

    Attributes
    ----------
    charts : indices of the charts, which differ from ingest to ingest.
    known : what tells the part from others: ids of charts, digests of objects.
    """

    run: Run = field(repr=False)
    charts: tuple[int, ...]
    known: tuple[object, ...]

    def digest_content(self) -> object:
        """Return what tells this part of a block from others, and the density of its charts."""
        return self.run.texture.texels_per_metre, self.known

    @property
    def store(self) -> StoreGroup:
        """Return the store that earlier results are read from."""
        return current_store()

    @property
    def plan(self) -> Plan:
        """Return the plan that the part is of."""
        return load_run_plan(self.run)

    @property
    def scene(self) -> Scene:
        """Return the scene that the part is of."""
        return self.plan.scene


def view_charts(run: Run, plan: Plan, charts: Sequence[int], *around: object) -> SceneView:
    """Return a view of some charts, and of what `around` tells of other parts of the block."""
    return SceneView(run, tuple(charts), (*(f"{plan.ids[chart]:016x}" for chart in charts), *around))


@dataclass(frozen=True)
class StoredCharts(SceneView):
    """Charts with the texels that an earlier stage wrote.

    Attributes
    ----------
    texel_digests : digest of the texels of each chart; None of one without.
    """

    texel_digests: tuple[str | None, ...] = ()

    @property
    def charts_with_texels(self) -> frozenset[int]:
        """Return the charts that have texels."""
        return frozenset(chart for chart, digest in zip(self.charts, self.texel_digests, strict=True) if digest)


def store_charts(
    run: Run, plan: Plan, charts: Sequence[int], digests: Mapping[str, str], places: Sequence[object] = ()
) -> StoredCharts:
    """Return charts with the texels of an earlier stage.

    Parameters
    ----------
    digests : digest of the texels of each chart, by its id.
    places : what else tells each chart.
    """
    names = [f"{plan.ids[chart]:016x}" for chart in charts]
    found = tuple(digests.get(name) for name in names)
    return StoredCharts(run, tuple(charts), (*zip(names, found, strict=True), *places), found)
