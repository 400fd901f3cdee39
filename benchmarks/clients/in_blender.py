"""What Blender does with files: run by the Python that has bpy, `python in_blender.py STEPS TOLD`, and needs nothing else of
this project.

STEPS is a JSON file of steps in order, each done to an empty scene; TOLD gets what each told. A step has `open`, the path of
a GLB, OBJ or USD file, and may have `export`, the path of a GLB to be written of the scene, and `render`
(`to`, `camera_position`,
`target`, `field_of_view`, `size` as height and width: a picture by Cycles on the processor).
"""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import bpy
from mathutils import Vector

SAMPLES = 16


def opened(path: str) -> None:
    """A file in an otherwise empty scene, z up, x east."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    suffix = Path(path).suffix
    if suffix == ".obj":
        bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
    elif suffix in (".usd", ".usda", ".usdc", ".usdz"):
        bpy.ops.wm.usd_import(filepath=path)
    else:
        bpy.ops.import_scene.gltf(filepath=path)


def held() -> dict[str, Any]:
    """What the scene holds: meshes, triangles, materials that show a picture, pictures with their sizes, custom properties."""
    meshes = [one for one in bpy.context.scene.objects if one.type == "MESH"]
    for one in meshes:
        one.data.calc_loop_triangles()
    shown = set()
    for one in bpy.data.materials:
        nodes = one.node_tree.nodes if one.node_tree else ()
        images = [node.image for node in nodes if node.type == "TEX_IMAGE" and node.image and node.outputs[0].is_linked]
        if any(image.size[0] for image in images):
            shown.add(one.name)
    slots = [slot.material for one in meshes for slot in one.material_slots]
    pictures = [one for one in bpy.data.images if one.size[0] and one.source == "FILE"]
    corners = [one.matrix_world @ Vector(corner) for one in meshes for corner in one.bound_box]
    return {
        "objects": sorted(one.name for one in meshes),
        "triangles": sum(len(one.data.loop_triangles) for one in meshes),
        "materials": len(bpy.data.materials),
        "materials_with_picture": len(shown),
        "slots_with_picture": sum(one is not None and one.name in shown for one in slots),
        "slots": len(slots),
        "pictures": {one.name: list(one.size) for one in pictures},
        "texture_bytes": sum(one.size[0] * one.size[1] * 4 for one in pictures),
        "attributes": sorted({name for one in meshes for name in list(one.keys())} - {"_RNA_UI"}),
        "low": [min(corner[axis] for corner in corners) for axis in range(3)] if corners else [],
        "high": [max(corner[axis] for corner in corners) for axis in range(3)] if corners else [],
        "version": bpy.app.version_string,
    }


def rendered(to: str, position: list[float], target: list[float], field_of_view: float, size: list[int]) -> None:
    """A picture of the scene's colours as materials have them, in no light, transparent where it shows nothing."""
    for material in bpy.data.materials:
        _unlit(material)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.sensor_fit, camera.data.angle = "HORIZONTAL", math.radians(field_of_view)
    camera.data.clip_start, camera.data.clip_end = 0.05, 5000
    camera.location = position
    camera.rotation_euler = (Vector(target) - Vector(position)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES
    scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling, scene.cycles.max_bounces = False, False, 2
    scene.cycles.pixel_filter_type = "BOX"
    scene.view_settings.view_transform = "Standard"
    render.film_transparent = True
    render.resolution_y, render.resolution_x, render.resolution_percentage = *size, 100
    render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGBA"
    render.filepath = to
    render.threads_mode, render.threads = "FIXED", 2
    scene.world = scene.world or bpy.data.worlds.new("world")
    bpy.ops.render.render(write_still=True)


def _unlit(material: Any) -> None:
    """Let the picture of a lit material shine by itself."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    for lit in [node for node in nodes if node.type == "BSDF_PRINCIPLED"]:
        base = lit.inputs["Base Color"]
        shining = nodes.new("ShaderNodeEmission")
        if base.is_linked:
            links.new(base.links[0].from_socket, shining.inputs["Color"])
        else:
            shining.inputs["Color"].default_value = base.default_value
        for link in list(lit.outputs["BSDF"].links):
            links.new(shining.outputs["Emission"], link.to_socket)


def main() -> None:
    steps, told = json.loads(Path(sys.argv[1]).read_text()), []
    for step in steps:
        start = time.monotonic()
        opened(step["open"])
        here = held() | {"seconds": time.monotonic() - start}
        if "export" in step:
            bpy.ops.export_scene.gltf(filepath=step["export"], export_format="GLB")
        if "render" in step:
            start = time.monotonic()
            rendered(**step["render"])
            here["render_seconds"] = time.monotonic() - start
        told.append(here)
    Path(sys.argv[2]).write_text(json.dumps(told))


if __name__ == "__main__":
    main()
