"""However a city is cut into blocks, every facade has the same texels, and so has all else that is textured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
import zarr

from facade_core.atlas.journal import read_journal
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import open_repository
from facade_core.plan.plan_tables import read_plan
from tasks.city.blocks import partition_city_file
from tasks.stages.order import STAGES_IN_ORDER
from tests.pipeline.stages import texture, write_block

pytestmark = pytest.mark.long

# Two rows of houses that stand against each other in pairs, along two streets and a third across.
HOUSES = {
    f"{side}{number}": (30 * number + 4 + 18 * half, 5 + 40 * row, 18 - 12 * half, 8.0, 7.0 + 2 * ((number + row) % 3))
    for number in range(3)
    for row in range(2)
    for half in range(2)
    for side in ["abcd"[2 * row + half]]
}
STREETS = {
    "1": [(0, 0), (60, 0), (125, 0)],
    "2": [(0, 40), (60, 40), (125, 40)],
    "3": [(60, -20), (60, 0), (60, 40), (60, 70)],
}


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("town")
    write_block(folder, buildings=HOUSES, streets=STREETS, texture={"texels_per_metre": 2})
    return folder


def made(town: Path, metres: int) -> tuple[int, dict[str, str], dict[int, np.ndarray]]:
    """Cut and textured: how many blocks it was, the digest of every facade by its id, and the colours of every chart by its."""
    keys = yaml.safe_load((town / "block.yaml").read_text()) | {"cut": {"metres": metres}}
    (town / f"{metres}.yaml").write_text(yaml.safe_dump(keys))
    out = town / f"out-{metres}"
    facades: dict[str, str] = {}
    charts: dict[int, np.ndarray] = {}
    blocks = partition_city_file(town / f"{metres}.yaml", out).blocks
    for block in blocks:
        run = texture(block.file, out / block.name).run
        session = open_repository(run.store).readonly_session("main")
        group, plan = zarr.open_group(session.store, mode="r"), read_plan(session)
        for record in filter(None, read_journal(group, "facades")):
            assert record["status"] == "done", record
            assert facades.setdefault(record["unit"], str(record["digests"])) is not None
        own = np.flatnonzero(plan.in_core)
        rasters = TexelLayout.of_charts(plan.scene.placement, own.tolist())
        colours = read_rasters(group["atlas/colour"], plan.scene.placement, rasters)
        found = {int(plan.ids[one]): colours[rasters.texel_slice(plan.scene.placement, one)] for one in own.tolist()}
        assert not found.keys() & charts.keys(), "what is textured in one block is textured in no other"
        charts |= found
    return len(blocks), facades, charts


def test_no_texel_depends_on_the_cut(town: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # what is encoded of the texels afterwards is told by them
    monkeypatch.setattr(
        "tests.pipeline.stages.STAGES_IN_ORDER", [kind for kind in STAGES_IN_ORDER if kind.forecast is not None]
    )
    (whole, facades, charts), *others = [made(town, metres) for metres in (5000, 70, 45)]
    assert [whole, *(count for count, _, _ in others)] == [1, 2, 6]
    assert len(facades) > 20
    for _, same, texels in others:
        assert same == facades
        assert texels.keys() == charts.keys()
        assert all(np.array_equal(texels[one], charts[one]) for one in charts)
