"""Gutters hang along eaves over streets, their pipes come down to the ground, vents stand in sight; all of few triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.types import SEMANTICS, Building, BuildingShell, Roof, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.buildings.settings import EAVES
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.terrain import build_terrain

OUTLINE = shapely.box(0, 0, 30, 12)
STATED = Roof("hipped", 3.0, pitch=27.0)
HOUSE = Building("a", OUTLINE, 9.0, "levels", roof=STATED)
STREET = Street("s", None, shapely.LineString([(-20, -8), (60, -8)]))
FAR = Street("s", None, shapely.LineString([(-20, -28), (60, -28)]))
FLAT = Roof("flat", 0.0, confidence=0.5)


def surfaces(*buildings: Building, street: Street = STREET) -> tuple[Charts, Mesh]:
    return build_block_surfaces(
        buildings, [street], terrain=build_terrain(buildings, None), ground_margin=20, largest=100
    )[:2]


def metal(charts: Charts, mesh: Mesh, building: int = 0) -> np.ndarray:
    """The triangles of gutters, pipes and vents, (t, 3, 3)."""
    own = (charts.kind[mesh.chart] == ChartKind.METAL) & (charts.building[mesh.chart] == building)
    return mesh.vertices[mesh.triangles[own]]


def with_gutters(house: Building = HOUSE) -> Building:
    return next(h for h in (replace(house, id=id) for id in "abcdef") if len(metal(*surfaces(h))))


def test_most_houses_have_gutters_over_the_street_and_pipes_to_the_ground() -> None:
    found = [metal(*surfaces(replace(HOUSE, id=id))) for id in map(str, range(24))]
    assert 18 <= sum(map(bool, map(len, found))) < 24
    for triangles in filter(len, found):
        corners = triangles.reshape(-1, 3)
        assert corners[:, 1].max() < 12.01, "nobody sees the back"
        assert corners[:, 1].min() == pytest.approx(-EAVES.overhang_m - 0.11, abs=1e-6)
        assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-9)
        assert corners[:, 2].max() < 9.01, "below the roof"
        low = corners[corners[:, 2] < 8]
        assert shapely.contains_xy(OUTLINE.buffer(0.11), *low[:, :2].T).all(), "pipes lie on the wall"
        # round three sides: a trough of 10 triangles for each, a pipe of 12 at the ends and the corners
        assert len(triangles) <= 3 * 10 + 4 * 12
    again = metal(*surfaces(replace(HOUSE, id="0")))
    np.testing.assert_array_equal(found[0], again)


def test_gutters_face_outwards_and_meet_at_a_corner() -> None:
    corner = Street("s", None, shapely.LineString([(-8, 40), (-8, -8), (60, -8)]))
    house = with_gutters()
    charts, mesh = surfaces(house, street=corner)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), charts.normals()[mesh.chart]) > 0).all()
    corners = metal(charts, mesh).reshape(-1, 3)
    reach = EAVES.overhang_m + 0.11
    assert np.hypot(*(corners[:, :2] + reach).T).min() < 1e-6, "one rim for both"


def test_a_pipe_ends_on_the_ground_and_on_the_foot_of_what_is_raised() -> None:
    house = with_gutters()
    assert metal(*surfaces(replace(house, base=20.0)))[..., 2].min() == pytest.approx(20.0)
    assert metal(*surfaces(replace(house, raised=4.0)))[..., 2].min() == pytest.approx(4.0)


def test_none_on_a_model() -> None:
    box = np.array([[x, y, z] for z in (0.0, 9.0) for x, y in ((0, 0), (30, 0), (30, 12), (0, 12))])
    faces = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)]
    faces += [t for i in range(4) for t in ((i, (i + 1) % 4, 4 + (i + 1) % 4), (i, 4 + (i + 1) % 4, 4 + i))]
    count = len(faces)
    none = np.full(count, SEMANTICS.index("unknown"), np.uint8), np.full(count, -1, np.int32)
    shell = BuildingShell(box, np.array(faces, np.int32), *none, np.zeros((count, 3, 2), np.float32))
    charts, _ = surfaces(Building("m", OUTLINE, 9.0, "model", shell=shell))
    assert not (charts.kind == ChartKind.METAL).any()


@pytest.mark.parametrize(
    ("roof", "street"), [(replace(STATED, confidence=0.5), FAR), (FLAT, FAR)], ids=["cowls", "boxes"]
)
def test_vents_stand_on_assumed_roofs_where_the_street_sees_them(roof: Roof, street: Street) -> None:
    houses = []
    for id in map(str, range(12)):
        with_vents, stated = (
            metal(*surfaces(replace(HOUSE, id=id, roof=one), street=street))
            for one in (roof, replace(roof, confidence=1.0))
        )
        more = len(with_vents) - len(stated)
        assert more in (0, 10, 20, 30, 40)
        top = with_vents.reshape(-1, 3)[with_vents.reshape(-1, 3)[:, 2] > 9.2] if more else np.empty((0, 3))
        assert shapely.contains_xy(OUTLINE, *top[:, :2].T).all()
        houses.append(more // 10)
    assert min(houses) == 0
    assert max(houses) > 1
    if roof is FLAT:
        hidden = Street("s", None, shapely.LineString([(5, -3), (25, -3)]))
        assert not any(len(metal(*surfaces(replace(HOUSE, id=str(i), roof=FLAT), street=hidden))) for i in range(4)), (
            "from below its edge nobody sees them"
        )
