"""OpenUSD: what Pixar's own library reads of an export, and what its validators say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tasks.export.formats import export_run
from tasks.publish.published_run import PublishedBlock

pxr = pytest.importorskip("pxr", reason="no pxr here; `make usd-setup` installs it")
Run = tuple[Path, dict[str, Any]]


@pytest.fixture(scope="module")
def folder(undisturbed: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(str(export_run(undisturbed[0], "usd", tmp_path_factory.mktemp("export") / "usd", relief="off").path))


def errors_of(stage: Any) -> list[str]:
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 20
    return [str(error.GetName()) for error in UsdValidation.ValidationContext(validators).Validate(stage)]


def test_the_validators_find_nothing_and_would(folder: Path) -> None:
    from pxr import Usd

    for file in (*folder.glob("*.usda"), *folder.glob("*.usdz"), *folder.glob("buildings/*.usdc")):
        stage = Usd.Stage.Open(str(file))
        assert errors_of(stage) == [], file.name
    stage.GetRootLayer().ClearDefaultPrim()
    assert errors_of(stage)


def test_buildings_stand_where_they_do_and_say_what_they_are(found: PublishedBlock, folder: Path) -> None:
    from pxr import Usd, UsdGeom

    (file,) = folder.glob("*.usda")
    stage = Usd.Stage.Open(str(file))
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Z", 1.0)
    origin = np.array(json.loads(stage.GetRootLayer().customLayerData["streetloom"]["origin"]))
    prims = {prim.GetDisplayName(): prim for prim in stage.GetDefaultPrim().GetChildren()}
    names = {found.names[b]: b for b in found.select_buildings(()).tolist()}
    assert prims.keys() == names.keys() | {"ground"}
    source = found.textured_mesh
    for name, building in names.items():
        assert prims[name].GetCustomDataByKey("streetloom:height_m") == pytest.approx(
            found.buildings["height"][building]
        )
        meshes = [prim for prim in Usd.PrimRange(prims[name]) if prim.IsA(UsdGeom.Mesh)]
        points = np.concatenate([np.array(UsdGeom.Mesh(mesh).GetPointsAttr().Get()) for mesh in meshes]) + origin
        mine = source.mesh.triangles[source.charts.building[source.mesh.chart] == building]
        corners = source.mesh.vertices[mine.ravel()]
        np.testing.assert_allclose(points.min(axis=0), corners.min(axis=0), atol=0.002)
        np.testing.assert_allclose(points.max(axis=0), corners.max(axis=0), atol=0.002)
        faces = sum(len(UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get()) for mesh in meshes)
        assert faces == len(mine)


def test_every_mesh_shows_a_picture_that_is_there(folder: Path) -> None:
    from pxr import Usd, UsdGeom, UsdShade

    for file in (*folder.glob("*.usda"), *folder.glob("*.usdz")):
        stage = Usd.Stage.Open(str(file))
        meshes = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
        assert meshes
        for prim in meshes:
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            shader = material.ComputeSurfaceSource()[0]
            assert shader.GetShaderId() == "UsdPreviewSurface"
            texture = UsdShade.Shader(shader.GetInput("diffuseColor").GetConnectedSource()[0].GetPrim())
            assert texture.GetInput("file").Get().resolvedPath
            maps = ("normal", "roughness", "metallic", "occlusion")
            read = [UsdShade.Shader(shader.GetInput(name).GetConnectedSource()[0].GetPrim()) for name in maps]
            assert all(one.GetInput("file").Get().resolvedPath for one in read)
            assert len({one.GetPath() for one in read}) == 2, "three of them are one picture's channels"
            uv = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").Get())
            assert len(uv) == len(UsdGeom.Mesh(prim).GetPointsAttr().Get())
            assert uv.min() >= 0
            assert uv.max() <= 1


def test_windows_shine_by_night_alone_and_one_choice_says_so_for_all(
    undisturbed: Run, folder: Path, tmp_path: Path
) -> None:
    from pxr import Usd, UsdShade

    def shining(stage: Any) -> int:
        surfaces = [UsdShade.Shader(prim) for prim in stage.Traverse() if prim.GetName() == "surface"]
        connected = [one.GetInput("emissiveColor") for one in surfaces if one.GetInput("emissiveColor")]
        assert all(one.GetConnectedSource()[0].GetPrim().IsDefined() for one in connected)
        return len(connected)

    (file,) = folder.glob("*.usda")
    stage = Usd.Stage.Open(str(file))
    assert shining(stage) == 0
    block = stage.GetDefaultPrim().GetVariantSet("time")
    assert (block.GetVariantNames(), block.GetVariantSelection()) == (["day", "night"], "day")
    block.SetVariantSelection("night")
    assert shining(stage) > 1
    assert errors_of(stage) == []
    night = export_run(undisturbed[0], "usd", tmp_path / "night", night=True)
    assert shining(Usd.Stage.Open(str(night.files[0]))) == shining(stage)
    unlit = export_run(undisturbed[0], "usd", tmp_path / "unlit", lit=False)
    assert not list(Path(str(unlit.path)).glob("textures/*normal*"))
    assert errors_of(Usd.Stage.Open(str(unlit.files[0]))) == []


def test_the_same_snapshot_gives_the_same_stages(undisturbed: Run, found: PublishedBlock, tmp_path: Path) -> None:
    name = found.names[int(found.select_buildings(())[-1])]
    one, two = (export_run(undisturbed[0], "usd", tmp_path / side, [name]).path for side in "ab")
    for file in sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file()):
        assert (one / file).read_bytes() == (two / file).read_bytes(), file
