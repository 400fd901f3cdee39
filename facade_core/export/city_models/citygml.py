"""CityGML 2.0: faces with rings, semantics and textures as elements of one streamed file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.export.attribution import Attribution
from facade_core.export.bodies.model_face import ModelFace, SemanticSurface
from facade_core.export.city_models.cityjson import METRES_PER_UNIT, UV_DECIMALS, VertexPool

if TYPE_CHECKING:
    from lxml.etree import _Element as Element
    from lxml.etree import _IncrementalFileWriter as XmlWriter

NAMESPACES = {
    None: "http://www.opengis.net/citygml/2.0",
    "gml": "http://www.opengis.net/gml",
    "xlink": "http://www.w3.org/1999/xlink",
    "app": "http://www.opengis.net/citygml/appearance/2.0",
    "bldg": "http://www.opengis.net/citygml/building/2.0",
    "dem": "http://www.opengis.net/citygml/relief/2.0",
    "gen": "http://www.opengis.net/citygml/generics/2.0",
}
# Name of the theme that readers select first.
THEME = "rgbTexture"
# Surface types that are nested in their wall.
OPENINGS = ("Window", "Door")
# Characters that XML forbids; they are written as Python escapes.
INVALID_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def expand_prefix(name: str) -> str:
    """Return a prefixed name such as bldg:Building in lxml's form; names without prefix belong to the core."""
    prefix, _, local = name.rpartition(":")
    return f"{{{NAMESPACES[prefix or None]}}}{local}"


def add_xml_element(parent: Element, name: str, text: object = None, /, **attributes: str) -> Element:
    """Add a child XML element; attributes are named as xlink_href for xlink:href."""
    from lxml import etree

    child = etree.SubElement(parent, expand_prefix(name))
    for key, value in attributes.items():
        prefix, _, local = key.rpartition("_")
        child.set(expand_prefix(f"{prefix}:{local}") if prefix else local, value)
    if text is not None:
        child.text = INVALID_XML.sub(lambda found: ascii(found[0])[1:-1], str(text))
    return child


def xml_id(name: str) -> str:
    """Convert a name to a valid XML id; invalid characters become their code, so ids stay distinct."""
    found = "".join(c if re.match(r"[A-Za-z0-9.-]", c) else f"_{ord(c):x}_" for c in name)
    return found if re.match(r"[A-Za-z_]", found) else f"_{found}"


@dataclass
class PolygonWriter:
    """Writer of one object's polygons with their texture targets.

    Attributes
    ----------
    prefix : prefix of the ids.
    pool : grid of the corners.
    low, high : (3,) bounds of the polygons so far.
    targets : per page, the ids of polygons with their rings and texture coordinates.
    count : polygons so far.
    """

    prefix: str
    pool: VertexPool
    low: Float64Array = field(default_factory=lambda: np.full(3, np.inf))
    high: Float64Array = field(default_factory=lambda: np.full(3, -np.inf))
    targets: dict[int, list[tuple[str, list[tuple[str, list[float]]]]]] = field(default_factory=dict)
    count: int = 0

    def add_polygon(self, parent: Element, face: ModelFace, name: str = "gml:Polygon") -> str | None:
        """Add a face as a child of `parent` and return its id; None without area on the grid."""
        rings = self.snap_rings(face)
        if not rings:
            return None
        id = f"{self.prefix}-p{self.count}"
        self.count += 1
        polygon = add_xml_element(parent, name, gml_id=id)
        shown: list[tuple[str, list[float]]] = []
        for number, (world, uv) in enumerate(rings):
            side = add_xml_element(polygon, "gml:interior" if number else "gml:exterior")
            _add_linear_ring(side, world, f"{id}-r{number}")
            self.low, self.high = np.minimum(self.low, world.min(axis=0)), np.maximum(self.high, world.max(axis=0))
            if uv is not None:
                shown.append((f"{id}-r{number}", np.concatenate([uv, uv[:1]]).ravel().tolist()))
        if face.page is not None:
            self.targets.setdefault(face.page, []).append((id, shown))
        return id

    def snap_rings(self, face: ModelFace) -> list[tuple[Float64Array, Float64Array | None]]:
        """Return corners (k, 3) and texture coordinates (k, 2) of a face's rings on the grid; empty without area."""
        rings: list[tuple[Float64Array, Float64Array | None]] = []
        for i, points in enumerate(face.rings):
            own = VertexPool(self.pool.origin)
            corners, places = own.add_ring(points, face.uv[i] if face.page is not None else None)
            if corners:
                world = np.array(list(own.vertices))[corners] * METRES_PER_UNIT + self.pool.origin
                rings.append((world, np.array(list(own.texture_vertices))[places] if places else None))
            elif not i:
                return []
        return rings

    def add_triangles(self, parent: Element, faces: Sequence[ModelFace]) -> None:
        """Add faces of three corners as a triangulated surface."""
        surface = add_xml_element(parent, "gml:TriangulatedSurface", gml_id=f"{self.prefix}-tin")
        patches = add_xml_element(surface, "gml:trianglePatches")
        for face in faces:
            self.add_polygon(patches, face, "gml:Triangle")
        for triangle in patches:  # patches have no ids
            del triangle.attrib[expand_prefix("gml:id")]
        self.targets = {
            page: [(f"{self.prefix}-tin", [ring for _, rings in of for ring in rings])]
            for page, of in self.targets.items()
        }

    def add_appearance(self, parent: Element, images: Sequence[str]) -> None:
        """Add the textures of the polygons so far.

        Parameters
        ----------
        parent : element of the object.
        images : file of every page.
        """
        if not self.targets:
            return
        holder = add_xml_element(add_xml_element(parent, "app:appearance"), "app:Appearance")
        add_xml_element(holder, "app:theme", THEME)
        for page, targets in self.targets.items():
            texture = add_xml_element(add_xml_element(holder, "app:surfaceDataMember"), "app:ParameterizedTexture")
            add_xml_element(texture, "app:isFront", "true")
            add_xml_element(texture, "app:imageURI", images[page])
            add_xml_element(texture, "app:mimeType", "image/jpeg")
            add_xml_element(texture, "app:textureType", "specific")
            add_xml_element(texture, "app:wrapMode", "none")
            for id, rings in targets:
                places = add_xml_element(add_xml_element(texture, "app:target", uri=f"#{id}"), "app:TexCoordList")
                for ring, uv in rings:
                    text = " ".join(f"{v:.{UV_DECIMALS}f}".rstrip("0").rstrip(".") for v in uv)
                    add_xml_element(places, "app:textureCoordinates", text, ring=f"#{ring}")


def _add_linear_ring(parent: Element, corners: Float64Array, id: str) -> None:
    ring = add_xml_element(parent, "gml:LinearRing")
    ring.set(expand_prefix("gml:id"), id)
    closed = np.concatenate([corners, corners[:1]])
    places = add_xml_element(ring, "gml:posList", " ".join(f"{v:.3f}" for v in closed.ravel().tolist()))
    places.set("srsDimension", "3")


def boundary_surfaces(
    writer: PolygonWriter, faces: Sequence[ModelFace], surfaces: Sequence[SemanticSurface], lod: str
) -> tuple[list[Element], list[str]]:
    """Build the bldg:boundedBy elements of an object's semantic surfaces; openings are nested in their wall.

    Parameters
    ----------
    writer : writer of the polygons.
    faces : faces of the object.
    surfaces : semantic surfaces that the faces index.
    lod : level of detail of the geometry.

    Returns
    -------
    The elements, and the ids of all polygons.
    """
    from lxml import etree

    ids: list[str] = []
    members: dict[int, Element] = {}
    bounds: dict[int, Element] = {}
    found: list[Element] = []

    def surface(index: int) -> Element:
        if index not in bounds:
            own = surfaces[index]
            if own["type"] in OPENINGS:
                within = add_xml_element(surface(own["parent"]), "bldg:opening")
            else:
                within = etree.Element(expand_prefix("bldg:boundedBy"), nsmap=NAMESPACES)
                found.append(within)
            bounds[index] = add_xml_element(within, f"bldg:{own['type']}", gml_id=f"{writer.prefix}-s{index}")
            if "facade" in own:
                add_attribute(bounds[index], "facade", own["facade"])
        return bounds[index]

    # openings follow all polygons of their wall
    for face in sorted(faces, key=lambda face: surfaces[face.semantic]["type"] in OPENINGS):
        owner = surface(face.semantic)
        if face.semantic not in members:
            multi = etree.Element(expand_prefix(f"bldg:lod{lod}MultiSurface"), nsmap=NAMESPACES)
            first = next((i for i, child in enumerate(owner) if child.tag == expand_prefix("bldg:opening")), len(owner))
            owner.insert(first, multi)
            members[face.semantic] = add_xml_element(multi, "gml:MultiSurface")
        holder = add_xml_element(members[face.semantic], "gml:surfaceMember")
        id = writer.add_polygon(holder, face)
        if id is None:
            members[face.semantic].remove(holder)
        else:
            ids.append(id)
    return found, ids


def solid_element(lod: str, ids: Sequence[str]) -> Element:
    """Build a bldg:lodNSolid of polygons that are defined elsewhere."""
    from lxml import etree

    holder = etree.Element(expand_prefix(f"bldg:lod{lod}Solid"), nsmap=NAMESPACES)
    shell = add_xml_element(
        add_xml_element(add_xml_element(holder, "gml:Solid"), "gml:exterior"), "gml:CompositeSurface"
    )
    for id in ids:
        add_xml_element(shell, "gml:surfaceMember", xlink_href=f"#{id}")
    return holder


def add_attribute(parent: Element, name: str, value: object) -> None:
    """Add a generic attribute of the value's type."""
    kind = {int: "int", float: "double"}.get(type(value), "string")
    add_xml_element(add_xml_element(parent, f"gen:{kind}Attribute", name=name), "gen:value", value)


@contextmanager
def open_citygml_writer(
    path: Path, title: str, crs: str, extent: Float64Array, attribution: Attribution
) -> Iterator[XmlWriter]:
    """Open a CityGML file whose members are written one at a time by `write` of the value.

    Parameters
    ----------
    path : file to write.
    title : name of the model.
    crs : reference system of the coordinates.
    extent : (2, 3) bounds of the members, metres.
    attribution : attribution, in the metadata and the description.
    """
    from lxml import etree

    with etree.xmlfile(str(path), encoding="utf-8") as file:
        file.write_declaration()
        with file.element(expand_prefix("CityModel"), nsmap=NAMESPACES):
            root = etree.Element("head", nsmap=NAMESPACES)
            said = add_xml_element(add_xml_element(root, "gml:metaDataProperty"), "gml:GenericMetaData")
            said.text = attribution.tags()["sources"]
            add_xml_element(root, "gml:description", attribution.line)
            add_xml_element(root, "gml:name", title)
            envelope = add_xml_element(
                add_xml_element(root, "gml:boundedBy"), "gml:Envelope", srsName=crs, srsDimension="3"
            )
            for name, corner in zip(("gml:lowerCorner", "gml:upperCorner"), extent, strict=True):
                add_xml_element(envelope, name, " ".join(f"{v:.3f}" for v in corner.tolist()))
            for element in root:
                file.write(element)
            yield file
