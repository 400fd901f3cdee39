"""Diagnosis of the environment: Python, packages, models and disk space."""

from __future__ import annotations

import platform
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path

from facade_core.core.errors import ModelFileError
from tasks.doctor.findings import Finding

PACKAGE = "streetloom"
ROOT = Path(__file__).resolve().parent.parent.parent
CONSTRAINTS = ROOT / "deploy" / "constraints" / "constraints.txt"
# Maximum number of packages named in one line.
MAX_NAMED_PACKAGES = 5
# Minimum for the smallest block, bytes.
MIN_FREE_BYTES = 1 << 30


def examine_machine(folder: Path) -> Iterator[Finding]:
    """Yield the findings about this machine; `folder`: location of the runs."""
    yield _check_python()
    yield from check_packages(requires(PACKAGE) or ())
    yield from check_models(_shipped_models())
    yield check_detectors()
    yield check_disk(folder)


def _check_python() -> Finding:
    from packaging.specifiers import SpecifierSet

    wanted = SpecifierSet(metadata(PACKAGE)["Requires-Python"] or "")
    found = platform.python_version()
    if found not in wanted:
        return Finding(
            "python", False, f"{found} is not {wanted}; set it up again with: make PYTHON=/path/to/python setup"
        )
    return Finding("python", True, f"{found} at {sys.executable}")


def check_packages(declared: Iterable[str]) -> Iterator[Finding]:
    """Compare installed packages with declared requirements and with the pinned versions."""
    from packaging.requirements import Requirement

    wrong, count = [], 0
    for requirement in map(Requirement, declared):
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        count += 1
        installed = _installed_version(requirement.name)
        if installed is None:
            wrong.append(f"{requirement.name} is missing")
        elif not requirement.specifier.contains(installed, prereleases=True):
            wrong.append(f"{requirement.name} {installed} is not {requirement.specifier}")
    if wrong:
        yield Finding("packages", False, f"{_shorten_list(wrong)}; `make setup` installs the pinned versions")
    else:
        yield Finding("packages", True, f"{count} as declared")
    if not CONSTRAINTS.is_file():
        return
    others = [
        f"{name} {found} (pinned {pinned})"
        for name, pinned in _read_constraints()
        if (found := _installed_version(name)) is not None and found != pinned
    ]
    if others:
        said = f"{len(others)} differ from the tested versions: {_shorten_list(others)}; `make setup` installs the tested ones"
        yield Finding("packages", None, said)


def _read_constraints() -> Iterator[tuple[str, str]]:
    from packaging.markers import Marker

    for line in CONSTRAINTS.read_text(encoding="utf-8").splitlines():
        if match := re.match(r"([\w.-]+)==([^\s;\\]+)\s*(?:;\s*([^\\]+))?", line):
            name, pinned, marker = match.groups()
            if marker is None or Marker(marker.strip()).evaluate():
                yield name, pinned


def _shipped_models() -> dict[Path, Callable[[Path], object]]:
    """Return the shipped model files, and the loader of each."""
    from facade_core.facade.layout import model as layouts
    from facade_core.facade.layout.network.windows import load_layout_network
    from facade_core.facade.variation import window_types
    from facade_core.parsing import network

    return {
        network.SHIPPED_NETWORK: network.load_network,
        layouts.SHIPPED_LAYOUT_MODEL: layouts.load_layout_model,
        layouts.SHIPPED_LAYOUT_NETWORK: load_layout_network,
        window_types.SHIPPED_WINDOW_METRIC: window_types.load_window_metric,
    }


def check_models(shipped: Mapping[Path, Callable[[Path], object]]) -> Iterator[Finding]:
    """Load each model file and report whether it is intact."""
    for path, load in shipped.items():
        try:
            load(path)
        except ModelFileError as error:
            yield Finding("models", False, str(error))
        else:
            yield Finding("models", True, f"{path.name} has its checksum and loads")


def check_detectors() -> Finding:
    """Report whether the optional detectors of faces, number plates and shop names are available."""
    from facade_core.imagery.detect import models as detect

    if lacking := detect.missing_packages():
        said = (
            f"faces, number plates and shop names are not detected, as {', '.join(lacking)} is missing; "
            f"the parser masks people and vehicles; {detect.INSTALL_REMEDY}"
        )
        return Finding("privacy", None, said)
    try:
        for model in detect.MODEL_FILES:
            detect.model_session(model)
    except ModelFileError as error:
        return Finding("privacy", False, str(error))
    return Finding("privacy", True, "faces, number plates and shop names are detected in pictures")


def check_disk(folder: Path, min_free_bytes: int = MIN_FREE_BYTES) -> Finding:
    """Report whether the disk of a folder has enough free bytes."""
    while not folder.exists():
        folder = folder.parent
    usage = shutil.disk_usage(folder)
    free = f"{usage.free / (1 << 30):.1f} GB free of {usage.total / (1 << 30):.0f} for {folder}"
    return Finding(
        "disk",
        usage.free >= min_free_bytes,
        free if usage.free >= min_free_bytes else f"{free}: make room before the next run",
    )


def _installed_version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _shorten_list(texts: list[str]) -> str:
    more = f" and {len(texts) - MAX_NAMED_PACKAGES} more" if len(texts) > MAX_NAMED_PACKAGES else ""
    return ", ".join(texts[:MAX_NAMED_PACKAGES]) + more
