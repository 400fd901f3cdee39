"""OpenUSD stages of textured meshes through Pixar's usd-core: metres, z up, one prim per building."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.export.models.glb import GltfNode
from facade_core.export.models.gltf_materials import DAY, NIGHT
from facade_core.export.models.settings import GLTF_MATERIALS

if TYPE_CHECKING:
    from pxr.Usd import Prim, Stage
    from pxr.UsdShade import Material, Output, Shader

# Name of the prim of a block, and of a city.
ROOT_PRIM = "Block"
CITY_PRIM = "City"
# Prefix of our keys in customData.
NAMESPACE = "streetloom"
# Variant set that selects DAY or NIGHT.
TIME_VARIANT_SET = "time"


@dataclass(frozen=True)
class TextureAssetPaths:
    """Asset paths of a page's textures, relative to a building's stage.

    Attributes
    ----------
    base_colour : colour.
    normal, orm : normals; occlusion, roughness and metalness; None if unlit.
    emissive : light at night; None where dark.
    """

    base_colour: str
    normal: str | None = None
    orm: str | None = None
    emissive: str | None = None


@dataclass(frozen=True)
class ZUpFrame:
    """Model frame with x east, y north, z up around an origin.

    Attributes
    ----------
    origin : (3,) world metres.
    """

    origin: Float64Array

    def points(self, world: Float64Array) -> Float64Array:
        """Return points (n, 3) of the world relative to the origin, metres."""
        return world - self.origin

    def directions(self, world: Float64Array) -> Float64Array:
        """Return directions (n, 3) of the world unchanged."""
        return world


def import_usd_library() -> ModuleType:
    """Import and return the package pxr.

    Raises
    ------
    InputError : usd-core is not installed; the message names the remedy.
    """
    try:
        import pxr.Usd
    except ImportError as error:
        raise InputError("--format usd: usd-core is not installed; `make usd-setup` installs it (220 MB)") from error
    package: ModuleType = pxr
    return package


def write_usd_building(
    path: Path,
    node: GltfNode,
    pages: Sequence[TextureAssetPaths],
    custom_data: Mapping[str, object],
    time: str | None = None,
) -> None:
    """Write the stage of one building: its meshes by page with their materials.

    Parameters
    ----------
    path : file to write.
    node : the building.
    pages : textures by page.
    custom_data : customData of the prim; values of None are left out.
    time : selected variant, DAY or NIGHT; None without variants.
    """
    import_usd_library()
    from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

    stage = create_stage(path)
    name = prim_identifier(node.name)
    prim = UsdGeom.Xform.Define(stage, f"/{name}").GetPrim()
    stage.SetDefaultPrim(prim)
    Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    prim.SetDisplayName(node.name)
    for key, value in custom_data.items():
        if value is not None:
            prim.SetCustomDataByKey(f"{NAMESPACE}:{key}", value)
    for primitive in node.primitives:
        material = _define_material(stage, f"/{name}/Looks/page_{primitive.material}", pages[primitive.material])
        mesh = UsdGeom.Mesh.Define(stage, f"/{name}/page_{primitive.material}")
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
    if time:
        _add_time_variants(prim, time, {NIGHT: lambda: _connect_emissive(stage, name, node, pages)})
    stage.GetRootLayer().Save()


def write_usd_block(
    path: Path, parts: Mapping[str, str], custom_data: Mapping[str, object], comment: str, time: str | None = None
) -> None:
    """Write a stage that references the stages of its buildings.

    Parameters
    ----------
    path : file to write.
    parts : asset path of each building, relative to the folder of the stage.
    custom_data : customLayerData of the layer.
    comment : attribution, as the comment of the layer.
    time : selected variant of all buildings; None without variants.
    """
    import_usd_library()
    from pxr import Kind, Usd, UsdGeom

    stage = create_stage(path)
    block = UsdGeom.Xform.Define(stage, f"/{ROOT_PRIM}").GetPrim()
    stage.SetDefaultPrim(block)
    Usd.ModelAPI(block).SetKind(Kind.Tokens.group)
    layer = stage.GetRootLayer()
    layer.comment = comment
    layer.customLayerData = {NAMESPACE: dict(custom_data)}
    for name, asset in parts.items():
        UsdGeom.Xform.Define(stage, f"/{ROOT_PRIM}/{prim_identifier(name)}").GetPrim().GetReferences().AddReference(
            asset
        )
    if time:

        def choose(one: str) -> None:
            for prim in block.GetChildren():
                prim.GetVariantSets().SetSelection(TIME_VARIANT_SET, one)

        _add_time_variants(block, time, {one: partial(choose, one) for one in (DAY, NIGHT)})
    layer.Save()


def write_usd_city(
    path: Path,
    parts: Iterable[tuple[str, str, Sequence[float]]],
    custom_data: Mapping[str, object],
    comment: str,
) -> None:
    """Write a stage with the stage of each block as a payload, which programs load on demand.

    Parameters
    ----------
    path : file to write.
    parts : name, asset path relative to the folder of the stage, and offset (x, y, z) in metres of each block.
    custom_data : customLayerData of the layer.
    comment : attribution, as the comment of the layer.
    """
    import_usd_library()
    from pxr import Gf, Kind, Sdf, Usd, UsdGeom

    stage = create_stage(path)
    city = UsdGeom.Xform.Define(stage, f"/{CITY_PRIM}")
    stage.SetDefaultPrim(city.GetPrim())
    Usd.ModelAPI(city.GetPrim()).SetKind(Kind.Tokens.assembly)
    layer = stage.GetRootLayer()
    layer.comment = comment
    layer.customLayerData = {NAMESPACE: dict(custom_data)}
    for name, asset, offset in parts:
        # declared in this layer alone: composing a payload here would load every block
        block = Sdf.CreatePrimInLayer(layer, f"/{CITY_PRIM}/{prim_identifier(name)}")
        block.specifier, block.typeName, block.kind = Sdf.SpecifierDef, "Xform", Kind.Tokens.group
        block.SetInfo("displayName", name)
        block.payloadList.Prepend(Sdf.Payload(asset))
        place = Sdf.AttributeSpec(block, "xformOp:translate", Sdf.ValueTypeNames.Double3)
        place.default = Gf.Vec3d(*map(float, offset))
        order = Sdf.AttributeSpec(block, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
        order.default = ["xformOp:translate"]
    layer.Save()


def write_usd_package(folder: Path, names: Sequence[str], path: Path) -> None:
    """Pack files of a folder as .usdz; the first name is the stage that opens."""
    import_usd_library()
    from pxr import Sdf

    with Sdf.ZipFileWriter.CreateNew(str(path)) as package:
        for name in names:
            package.AddFile(str(folder / name), name)


def prim_identifier(name: str) -> str:
    """Return a valid prim name; invalid characters become their code, so names stay distinct."""
    found = "".join(c if c.isascii() and c.isalnum() else f"_{ord(c):x}_" for c in name)
    return found if found[:1].isalpha() else f"_{found}"


def create_stage(path: Path) -> Stage:
    """Create a stage with z up, in metres."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    return stage


def _add_time_variants(prim: Prim, first: str, edits: Mapping[str, Callable[[], None]]) -> None:
    """Add the variants DAY and NIGHT, make the edits of each, and select `first`."""
    variants = prim.GetVariantSets().AddVariantSet(TIME_VARIANT_SET)
    for name in (DAY, NIGHT):
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            edits.get(name, lambda: None)()
    variants.SetVariantSelection(first)


def _define_material(stage: Stage, path: str, page: TextureAssetPaths) -> Material:
    """Define a UsdPreviewSurface with the textures of a page."""
    from pxr import Sdf, UsdShade

    material = UsdShade.Material.Define(stage, path)
    surface, reader = (UsdShade.Shader.Define(stage, f"{path}/{name}") for name in ("surface", "st"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    place = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    kinds = Sdf.ValueTypeNames
    surface.CreateIdAttr("UsdPreviewSurface")
    colour = _define_texture(stage, f"{path}/colour", page.base_colour, place, "sRGB")
    surface.CreateInput("diffuseColor", kinds.Color3f).ConnectToSource(colour.CreateOutput("rgb", kinds.Float3))
    if page.normal and page.orm:
        normal = _define_texture(stage, f"{path}/normal", page.normal, place, "raw", scale=2.0, bias=-1.0)
        surface.CreateInput("normal", kinds.Normal3f).ConnectToSource(normal.CreateOutput("rgb", kinds.Float3))
        orm = _define_texture(stage, f"{path}/orm", page.orm, place, "raw")
        for channel, name in zip("rgb", ("occlusion", "roughness", "metallic"), strict=True):
            surface.CreateInput(name, kinds.Float).ConnectToSource(orm.CreateOutput(channel, kinds.Float))
    else:
        surface.CreateInput("roughness", kinds.Float).Set(GLTF_MATERIALS.default_roughness)
        surface.CreateInput("metallic", kinds.Float).Set(0.0)
    surface.CreateInput("ior", kinds.Float).Set(GLTF_MATERIALS.index_of_refraction)
    out = surface.CreateOutput("surface", kinds.Token)
    material.CreateSurfaceOutput().ConnectToSource(out)
    return material


def _connect_emissive(stage: Stage, name: str, node: GltfNode, pages: Sequence[TextureAssetPaths]) -> None:
    """Connect the emissive textures of a building."""
    from pxr import Sdf, UsdShade

    for primitive in node.primitives:
        path, emissive = f"/{name}/Looks/page_{primitive.material}", pages[primitive.material].emissive
        if emissive:
            place = UsdShade.Shader.Get(stage, f"{path}/st").GetOutput("result")
            texture = _define_texture(
                stage, f"{path}/glow", emissive, place, "sRGB", scale=GLTF_MATERIALS.emissive_strength
            )
            surface = UsdShade.Shader.Get(stage, f"{path}/surface")
            lit = surface.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f)
            lit.ConnectToSource(texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))


def _define_texture(
    stage: Stage, path: str, picture: str, place: Output, space: str, *, scale: float = 1.0, bias: float = 0.0
) -> Shader:
    """Define a UsdUVTexture at the coordinates of `place`; values are scaled and shifted by `bias`."""
    from pxr import Gf, Sdf, UsdShade

    texture = UsdShade.Shader.Define(stage, path)
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(picture)
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(place)
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
    for side in ("wrapS", "wrapT"):
        texture.CreateInput(side, Sdf.ValueTypeNames.Token).Set("clamp")
    if (scale, bias) != (1.0, 0.0):
        texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(scale, scale, scale, 1.0))
        texture.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(bias, bias, bias, 0.0))
    return texture
