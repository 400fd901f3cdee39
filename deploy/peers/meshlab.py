"""MeshLab's texture from registered rasters: `meshlab.py FOLDER TEXELS` textures FOLDER/project.mlp.

It writes FOLDER/texture.png, of TEXELS a side, and FOLDER/uv.npy, (faces, 3, 2), zeros where a face has no texture. The filter
draws with OpenGL in Qt's window system: an X server in memory (Xvfb) is started for it, and Qt's plugin for X comes from
PyQt5-Qt5, as PyMeshLab ships without it.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

PACKAGES = Path(sys.prefix) / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"


def main(folder: Path, texels: str) -> dict[str, float]:
    if (server := shutil.which("Xvfb")) is None:
        raise SystemExit("no Xvfb on this machine; Debian's package xvfb brings it")
    screen, number = ["-screen", "0", "640x480x24", "-nolisten", "tcp"], os.pipe()
    words = [server, *screen, "-displayfd", str(number[1])]
    with subprocess.Popen(words, pass_fds=[number[1]], stderr=subprocess.DEVNULL) as display:
        try:
            plugins = PACKAGES / "PyQt5" / "Qt5" / "plugins"
            environment = os.environ | {
                "DISPLAY": f":{os.read(number[0], 16).decode().strip()}",
                "QT_PLUGIN_PATH": str(plugins),
                "QT_QPA_PLATFORM_PLUGIN_PATH": str(plugins / "platforms"),
                "QT_QPA_PLATFORM": "xcb",
                "LD_LIBRARY_PATH": str(PACKAGES / "pymeshlab" / "lib"),
                "LP_NUM_THREADS": "1",  # of the software that draws, as everything measured beside it has one thread
            }
            start = time.perf_counter()
            command = [sys.executable, __file__, "inside", str(folder), texels]
            subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
            used = resource.getrusage(resource.RUSAGE_CHILDREN)
            return {
                "seconds": time.perf_counter() - start,
                "processor_seconds": used.ru_utime + used.ru_stime,
                "memory_mb": used.ru_maxrss / 1024,
            }
        finally:
            display.terminate()


def texture(folder: Path, texels: int) -> None:
    import numpy as np
    import pymeshlab

    os.chdir(folder)
    meshes = pymeshlab.MeshSet()
    meshes.load_project("project.mlp")
    meshes.compute_texcoord_parametrization_and_texture_from_registered_rasters(
        texturesize=texels, texturename="texture.png"
    )
    meshes.save_current_mesh("textured.ply", save_textures=True)
    np.save("uv.npy", meshes.current_mesh().wedge_tex_coord_matrix().reshape(-1, 3, 2))


if __name__ == "__main__":
    if sys.argv[1] == "inside":
        texture(Path(sys.argv[2]), int(sys.argv[3]))
    else:
        print(json.dumps(main(Path(sys.argv[1]), sys.argv[2])))
