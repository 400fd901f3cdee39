"""Street centrelines of GraphML as OSMnx writes it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import SupportsFloat

import networkx
import shapely
from defusedxml import DefusedXmlException, ElementTree
from pyproj import CRS
from pyproj.exceptions import CRSError
from shapely import LineString
from shapely.geometry.base import BaseGeometry

from catalogs.features import CentrelinesAndGround, Fault, GroundFeature
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.vectors.centrelines import build_centrelines
from catalogs.readers.vectors.osm import is_street, split_osmnx_values
from facade_core.core.errors import InputError


def read_graphml_centrelines(path: Path) -> CentrelinesAndGround:
    """Read the edges of a street graph as centrelines, one for both directions.

    An edge without a geometry is a straight line between its nodes. With `highway` attributes only streets of
    catalogs.readers.vectors.osm.is_street are read.

    Raises
    ------
    InputError
        Where the file is no GraphML of a graph.
    """
    graph = _load_graph(path)
    places = {
        node: place for node, attributes in graph.nodes(data=True) if (place := _node_position(attributes)) is not None
    }
    edges = [(start, end, _attribute_texts(attributes)) for start, end, attributes in graph.edges(data=True)]
    from_osm = any("highway" in tags for _, _, tags in edges)
    nowhere: dict[str, None] = {}
    ground: list[GroundFeature] = []

    def streets() -> Iterator[tuple[str, BaseGeometry | None, str | None, Mapping[str, str]]]:
        for start, end, tags in edges:
            line = None
            plain = {key: split_osmnx_values(value)[0] for key, value in tags.items() if key != "geometry"}
            if "geometry" in tags:
                line = shapely.from_wkt(tags["geometry"], on_invalid="ignore")
            elif start in places and end in places:
                line = LineString([places[start], places[end]])
            if line is not None:
                ground.append(GroundFeature(f"{start}-{end}", line, plain))
            if from_osm and ("highway" not in tags or not is_street(line or LineString(), tags)):
                continue
            if "geometry" not in tags and line is None:
                nowhere.update(dict.fromkeys(node for node in (start, end) if node not in places))
                continue
            osmid = plain.get("osmid", "")
            id = f"w{osmid}" if osmid.isdigit() else f"{start}-{end}"
            yield id, line, plain.get("name"), plain

    found = build_centrelines(_graph_crs(path, graph.graph.get("crs")), streets())
    reason = "node {} of the street graph has no x and y; give it both, or remove its edges"
    faults = (*found.faults, *(Fault(node, "street", reason.format(node)) for node in nowhere))
    return replace(found, faults=faults, ground=tuple(ground))


def _load_graph(path: Path) -> networkx.Graph:

    with wrap_reader_errors(path, "cannot be read as GraphML", "write it with osmnx.save_graphml"):
        try:
            ElementTree.parse(str(path), forbid_dtd=True)  # networkx's own parser expands entities
        except DefusedXmlException as error:
            raise InputError(
                f"{path} declares XML entities or a document type; write it with osmnx.save_graphml"
            ) from error
        return networkx.read_graphml(path)


def _attribute_texts(attributes: Mapping[str, object]) -> dict[str, str]:
    texts = {key: str(value).strip() for key, value in attributes.items()}
    return {key: text for key, text in texts.items() if text and text.lower() not in ("nan", "none")}


def _node_position(attributes: Mapping[str, SupportsFloat | str]) -> tuple[float, float] | None:
    try:
        x, y = float(attributes["x"]), float(attributes["y"])
    except (KeyError, TypeError, ValueError):
        return None
    return (x, y) if math.isfinite(x) and math.isfinite(y) else None


def _graph_crs(path: Path, stated: object) -> str | None:
    """Return EPSG:n or WKT of the graph's attribute `crs`, which old versions write as {'init': 'epsg:n'}."""
    if stated is None or str(stated).strip() in ("", "None"):
        return None
    text = str(stated).strip()
    if match := re.search(r"init\W+(epsg:\d+)", text, re.IGNORECASE):
        text = match[1]
    try:
        authority = CRS.from_user_input(text).to_authority()
    except CRSError as error:
        raise InputError(f"{path} states the frame {text[:60]!r}, which is not known; write EPSG:n") from error
    return ":".join(authority) if authority else text
