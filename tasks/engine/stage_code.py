"""Digests of the code of each stage: the modules that its worker imports, their data files, and the versions of libraries.

A change makes pending what it reaches, and nothing else; see `facade_core.core.code_modules` for what counts of a module.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from facade_core.core.code_modules import collect_modules, content_digest, module_path
from facade_core.imagery.detect.models import models_digest
from tasks.engine.data_files import DATA_FILES

VERSION = "0.1.0"
ROOT = Path(__file__).resolve().parent.parent.parent
CODE_PACKAGES = ("facade_core", "catalogs", "tasks")

# What finds models in packages that may be installed or not: both the presence and the content of these count.
DETECTION_MODELS = "facade_core.imagery.detect.models"
# What decides when and where units run, keeps what they made, or says what went wrong. A run's settings are in the keys.
EXCLUDED_MODULES = frozenset(
    {
        "facade_core.core.code_modules",
        "facade_core.core.errors",
        "facade_core.atlas.journal",
        "facade_core.atlas.store",
        "facade_core.core.zarr_types",
        "tasks.engine.store.commits",
        "tasks.engine.inputs",
        "tasks.engine.outcome",
        "tasks.engine.progress",
        "tasks.engine.store.disk_space",
        "tasks.engine.run",
        "tasks.engine.unit",
        "tasks.engine.stage_code",
        "tasks.stages.order",
        "tasks.engine.store.integrity",
    }
)
# Likewise of libraries; and what encodes pictures of exports alone, which no unit does, or rewrites the header of a model whose
# content counts (an environment for tests has it, one for users only where that model is).
EXCLUDED_LIBRARIES = frozenset(
    {
        "alktx2",
        "dask",
        "distributed",
        "icechunk",
        "onnx",
        "prefect",
        "psutil",
        "threadpoolctl",
        "xarray",
        "zarr",
    }
)
# Under which name a library is installed, where that is not the one it is imported by.
DISTRIBUTION_NAMES = {
    "PIL": "pillow",
    "cv2": "opencv-python-headless",
    "google": "protobuf",
    "maxflow": "PyMaxflow",
    "ruamel": "ruamel.yaml",
    "skimage": "scikit-image",
    "yaml": "pyyaml",
}


@cache
def stage_code_digest(stage: str, *, root: Path = ROOT) -> str:
    """Compute the digest of the code of a stage.

    Parameters
    ----------
    stage : name of the stage.
    root : folder of the packages.
    """
    found = collect_modules([worker_module(stage, root)], EXCLUDED_MODULES, root, CODE_PACKAGES)
    digest = blake2b(digest_size=8)
    for name in sorted(found):
        digest.update(f"{name} {found[name].digest}\n".encode())
    for file in sorted({file for name in found for file in DATA_FILES.get(name, ())}):
        digest.update(f"{file} {content_digest(root / file)}\n".encode())
    digest.update(f"python {sys.version_info.major}.{sys.version_info.minor}\n".encode())
    outside = {name.partition(".")[0] for module in found.values() for name, _ in module.imports}
    for library in sorted(outside - sys.stdlib_module_names - EXCLUDED_LIBRARIES - set(CODE_PACKAGES)):
        digest.update(f"{library} {_library_version(library)}\n".encode())
    if DETECTION_MODELS in found:
        digest.update(f"detect {models_digest()}\n".encode())
    return digest.hexdigest()


def worker_module(stage: str, root: Path = ROOT) -> str:
    """Return the dotted name of the module that processes a stage's units, or of a module of `tasks`."""
    places = (f"tasks.stages.{stage}.worker", f"tasks.stages.{stage}.task", f"tasks.{stage}.task", f"tasks.{stage}")
    return next(name for name in places if module_path(name, root) is not None)


@cache
def code_version(stages: tuple[str, ...], root: Path = ROOT) -> str:
    """Return the version and a digest of the code of some stages: workers of one cluster must agree on it."""
    return join_code_versions({stage: stage_code_digest(stage, root=root) for stage in stages})


def join_code_versions(codes: Mapping[str, str]) -> str:
    """Return the version of the package and a digest of the codes of some stages."""
    text = "\n".join(f"{stage} {code}" for stage, code in sorted(codes.items()))
    return f"{VERSION}+{blake2b(text.encode(), digest_size=6).hexdigest()}"


@cache
def _library_version(library: str) -> str:
    try:
        return version(DISTRIBUTION_NAMES.get(library, library))
    except PackageNotFoundError:
        return "none"
