"""OpenUSD stages of textured parts, through Pixar's usd-core: metres, z up, one prim a building."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.errors import InputError
from facade_core.export.glb import Node

# A building's and the block's prims, and the names that customData has of ours.
ROOT, NAMESPACE = "Block", "streetloom"
# Plaster, stone and brick scatter light; nothing is told apart within a page.
ROUGHNESS, REFRACTION = 0.9, 1.5


@dataclass(frozen=True)
class ZUpFrame:
    """x east, y north, z up, around `origin` (3,) in world metres: what models.Frame is where z is up."""

    origin: np.ndarray

    def points(self, world: np.ndarray) -> np.ndarray:
        return world - self.origin

    def directions(self, world: np.ndarray) -> np.ndarray:
        return world


def usd_module() -> Any:
    """The package pxr. Raises InputError with the remedy where it is not installed."""
    try:
        import pxr.Usd
    except ImportError as error:
        raise InputError(
            "--format usd: usd-core is not installed, as it takes 220 MB; `make usd-setup` does"
        ) from error
    return pxr


def write_building(path: Path, node: Node, pictures: Sequence[str], said: Mapping[str, Any]) -> None:
    """A stage of one node: its meshes by picture, and a lit material for each of these.

    pictures: the asset paths of all pages, from the stage's folder; said: what the prim says of itself, in customData.
    """
    usd_module()
    from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

    stage = _stage(path)
    name = identifier(node.name)
    prim = UsdGeom.Xform.Define(stage, f"/{name}").GetPrim()
    stage.SetDefaultPrim(prim)
    Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    prim.SetDisplayName(node.name)
    for key, value in said.items():
        if value is not None:
            prim.SetCustomDataByKey(f"{NAMESPACE}:{key}", value)
    for primitive in node.primitives:
        material = _material(stage, f"/{name}/Looks/page_{primitive.picture}", pictures[primitive.picture])
        mesh = UsdGeom.Mesh.Define(stage, f"/{name}/page_{primitive.picture}")
        points = primitive.position.astype(np.float32)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(primitive.normal, np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        triangles = primitive.triangles.astype(np.int32)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateExtentAttr([Gf.Vec3f(*map(float, edge)) for edge in (points.min(axis=0), points.max(axis=0))])
        uv = np.column_stack([primitive.uv[:, 0], 1 - primitive.uv[:, 1]]).astype(np.float32)
        kind = Sdf.ValueTypeNames.TexCoord2fArray
        place = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, UsdGeom.Tokens.vertex)
        place.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv)))
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.GetRootLayer().Save()


def write_block(path: Path, parts: Mapping[str, str], said: Mapping[str, Any], comment: str) -> None:
    """A stage that references those of its parts: name -> the asset path, from the stage's folder. said: in the layer's
    customLayerData; comment: the layer's, whom to name."""
    usd_module()
    from pxr import Kind, Usd, UsdGeom

    stage = _stage(path)
    block = UsdGeom.Xform.Define(stage, f"/{ROOT}").GetPrim()
    stage.SetDefaultPrim(block)
    Usd.ModelAPI(block).SetKind(Kind.Tokens.group)
    layer = stage.GetRootLayer()
    layer.comment = comment
    layer.customLayerData = {NAMESPACE: dict(said)}
    for name, asset in parts.items():
        UsdGeom.Xform.Define(stage, f"/{ROOT}/{identifier(name)}").GetPrim().GetReferences().AddReference(asset)
    layer.Save()


def write_package(folder: Path, names: Sequence[str], path: Path) -> None:
    """Files of a folder, by their paths in it, as one .usdz file; the first is the stage that it opens."""
    usd_module()
    from pxr import Sdf

    with Sdf.ZipFileWriter.CreateNew(str(path)) as package:
        for name in names:
            package.AddFile(str(folder / name), name)


def identifier(name: str) -> str:
    """A name as a prim may have it: what it cannot have as its code, so that no two names become one."""
    found = "".join(c if c.isascii() and c.isalnum() else f"_{ord(c):x}_" for c in name)
    return found if found[:1].isalpha() else f"_{found}"


def _stage(path: Path) -> Any:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    return stage


def _material(stage: Any, path: str, picture: str) -> Any:
    """A UsdPreviewSurface that shows a picture, lit."""
    from pxr import Sdf, UsdShade

    material = UsdShade.Material.Define(stage, path)
    surface, texture, reader = (
        UsdShade.Shader.Define(stage, f"{path}/{name}") for name in ("surface", "texture", "st")
    )
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    place = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(picture)
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(place)
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    for side in ("wrapS", "wrapT"):
        texture.CreateInput(side, Sdf.ValueTypeNames.Token).Set("clamp")
    colour = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(colour)
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(ROUGHNESS)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    surface.CreateInput("ior", Sdf.ValueTypeNames.Float).Set(REFRACTION)
    out = surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(out)
    return material
