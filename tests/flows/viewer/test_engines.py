"""The libraries of the viewer's page are the files that their checksums, their licences and the lock file name."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from flows.viewer.app import PAGE_FOLDER

VENDOR = PAGE_FOLDER / "vendor"
ENGINES = Path(PAGE_FOLDER).parent / "engines"


def test_vendored_files_match_their_checksums() -> None:
    lines = (VENDOR / "SHA256SUMS").read_text("utf-8").splitlines()
    sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
    files = {path.name: path for path in VENDOR.iterdir() if path.name != "SHA256SUMS"}
    assert files.keys() == sums.keys()
    for name, path in files.items():
        assert hashlib.sha256(path.read_bytes()).hexdigest() == sums[name], name
    assert sum(path.stat().st_size for path in files.values()) < 2_700_000


def test_vendored_licences_are_of_the_locked_versions() -> None:
    lock = json.loads((ENGINES / "package-lock.json").read_text("utf-8"))["packages"]
    licences = (VENDOR / "LICENCES.txt").read_text("utf-8").splitlines()
    for name in json.loads((ENGINES / "package.json").read_text("utf-8"))["dependencies"]:
        locked = lock[f"node_modules/{name}"]
        assert f"{name} {locked['version']}, {locked['license']}" in licences
        assert locked["integrity"].startswith("sha512-")
    assert not [name for name, one in lock.items() if "resolved" in one], "a lock file names no registry"
