"""Street graphs written as OSMnx writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import networkx
import pytest

from catalogs.readers.vectors.graphml import read_graphml_centrelines
from facade_core.core.errors import InputError


def street(name: str = "", **more: str) -> dict[str, str]:
    return {"osmid": "1", "highway": "residential", "name": name} | more


@pytest.fixture
def written(tmp_path: Path) -> Any:
    def write(
        edges: list[tuple[str, str, dict[str, str]]], crs: str | None = "epsg:4326", **nodes: dict[str, str]
    ) -> Path:
        graph = networkx.MultiDiGraph(**({"crs": crs} if crs else {}))
        places = {"1": (24.94, 60.16), "2": (24.95, 60.16), "3": (24.95, 60.17)}
        graph.add_nodes_from((node, {"x": str(x), "y": str(y)}) for node, (x, y) in places.items())
        graph.add_nodes_from(nodes.items())
        graph.add_edges_from((start, end, data) for start, end, data in edges)
        path = tmp_path / "streets.graphml"
        networkx.write_graphml(graph, path)
        return path

    return write


def test_both_directions_are_one_street(written: Any) -> None:
    bent = "LINESTRING (24.95 60.16, 24.96 60.165, 24.95 60.17)"
    back = "LINESTRING (24.95 60.17, 24.96 60.165, 24.95 60.16)"
    found = read_graphml_centrelines(
        written(
            [
                ("1", "2", street("Main Street")),
                ("2", "1", street("Main Street", reversed="True")),
                ("2", "3", street("['Bent', 'Other']", osmid="[12, 13]", geometry=bent)),
                ("3", "2", street("['Other', 'Bent']", osmid="[13, 12]", geometry=back)),
                ("2", "3", street("", osmid="14")),
            ]
        )
    )
    assert found.crs == "EPSG:4326"
    assert [(piece.id, piece.name) for piece in found.items] == [("w1", "Main Street"), ("w12", "Bent"), ("w14", None)]
    assert [len(piece.line.coords) for piece in found.items] == [2, 3, 2]
    assert found.faults == ()


def test_footways_service_roads_and_tunnels_are_left_out(written: Any) -> None:
    kinds = ["footway", "service", "['service', 'tertiary']", "['footway', 'steps']", "primary_link"]
    edges = [
        ("1", "2", street(str(i), highway=kind, geometry=f"LINESTRING (0 {i}, 1 {i})")) for i, kind in enumerate(kinds)
    ]
    found = read_graphml_centrelines(written([*edges, ("2", "3", street("under", tunnel="yes"))]))
    assert [piece.name for piece in found.items] == ["2", "4"]


def test_what_is_broken_is_a_fault(written: Any) -> None:
    found = read_graphml_centrelines(
        written(
            [
                ("1", "2", street("good")),
                ("1", "9", street("nowhere")),
                ("1", "1", street("short", osmid="5")),
                ("2", "3", street("bad", osmid="6", geometry="LINESTRING (1 2")),
                ("2", "3", street("nan", osmid="7", geometry="LINESTRING (1 2, nan 3)")),
                ("1", "9", street("drawn", osmid="8", geometry="LINESTRING (1 2, 2 3)")),
            ],
            **{"9": {"x": "east", "y": "60"}},
        )
    )
    assert [piece.name for piece in found.items] == ["good", "drawn"]
    assert [fault.id for fault in found.faults] == ["w5", "w6", "w7", "9"]
    assert {fault.kind for fault in found.faults} == {"street"}


@pytest.mark.parametrize(
    ("crs", "expected"), [("{'init': 'epsg:3067'}", "EPSG:3067"), (None, None), ("EPSG:28992", "EPSG:28992")]
)
def test_frames(written: Any, crs: str | None, expected: str | None) -> None:
    assert read_graphml_centrelines(written([("1", "2", street())], crs=crs)).crs == expected


def test_an_unknown_frame_is_refused(written: Any) -> None:
    with pytest.raises(InputError, match=r"streets\.graphml.*nonsense"):
        read_graphml_centrelines(written([("1", "2", street())], crs="nonsense"))


BOMB = '<?xml version="1.0"?><!DOCTYPE g [<!ENTITY a "b">]><graphml xmlns="http://graphml.graphdrawing.org/xmlns"/>'


@pytest.mark.parametrize("text", ["", "<graphml", "<html/>", BOMB])
def test_other_files_are_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "streets.graphml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"streets\.graphml"):
        read_graphml_centrelines(path)
