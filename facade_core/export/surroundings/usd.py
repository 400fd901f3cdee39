"""Surroundings of a block in OpenUSD: a PointInstancer over a prototype for each model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.street_objects import PlacedObjects, heading_axes
from facade_core.core.surrounding_mesh import SurroundingMesh
from facade_core.export.models.usd import ZUpFrame, create_stage
from facade_core.export.surroundings.colours import surrounding_colours
from facade_core.export.surroundings.models import ObjectModel, build_object_model

if TYPE_CHECKING:
    from pxr.Usd import Stage
    from pxr.UsdShade import Material

ROOT = "/surroundings"


def write_usd_surroundings(path: Path, placed: PlacedObjects, around: SurroundingMesh, frame: ZUpFrame) -> None:
    """Write the stage of the surroundings of a block.

    Parameters
    ----------
    path : file to write.
    placed : objects of the street.
    around : buildings and ground around the block.
    frame : frame of the block.
    """
    from pxr import Gf, UsdGeom, Vt

    stage = create_stage(path)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
    material = _define_material(stage)
    if len(around):
        points = frame.points(around.vertices)
        mesh = ObjectModel(points, around.normal, surrounding_colours(around), around.triangles.astype(np.int64))
        _define_model(stage, f"{ROOT}/neighbours", mesh, material)
    instancer = UsdGeom.PointInstancer.Define(stage, f"{ROOT}/objects")
    number = np.zeros(len(placed), np.int32)
    factors = np.ones((len(placed), 3))
    for index, (kind, variant, rows) in enumerate(placed.rows_by_model()):
        prototype = f"{ROOT}/objects/models/{kind.name}_{variant}"
        _define_model(stage, prototype, build_object_model(kind, variant), material)
        instancer.CreatePrototypesRel().AddTarget(prototype)
        number[rows], factors[rows] = index, placed.size[rows] / kind.size
    ahead = heading_axes(placed.heading)[:, 1]
    half = np.arctan2(-ahead[:, 0], ahead[:, 1]) / 2
    turns = [Gf.Quath(float(np.cos(one)), 0.0, 0.0, float(np.sin(one))) for one in half]
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(number))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(frame.points(placed.position).astype(np.float32)))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(factors.astype(np.float32)))
    instancer.CreateOrientationsAttr(Vt.QuathArray(turns))
    stage.GetRootLayer().Save()


def _define_model(stage: Stage, path: str, model: ObjectModel, material: Material) -> None:
    from pxr import UsdGeom, UsdShade, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(model.position.astype(np.float32)))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(model.normal.astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(model.triangles), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(model.triangles.astype(np.int32).ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    colour = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    colour.Set(Vt.Vec3fArray.FromNumpy(model.colour.astype(np.float32)))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _define_material(stage: Stage) -> Material:
    """Define the material of all objects: the colours of vertices."""
    from pxr import Sdf, UsdShade

    path, kinds = f"{ROOT}/Looks/objects", Sdf.ValueTypeNames
    material = UsdShade.Material.Define(stage, path)
    surface, reader = (UsdShade.Shader.Define(stage, f"{path}/{name}") for name in ("surface", "colour"))
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", kinds.String).Set("displayColor")
    surface.CreateIdAttr("UsdPreviewSurface")
    shown = reader.CreateOutput("result", kinds.Float3)
    surface.CreateInput("diffuseColor", kinds.Color3f).ConnectToSource(shown)
    surface.CreateInput("roughness", kinds.Float).Set(1.0)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", kinds.Token))
    return material
