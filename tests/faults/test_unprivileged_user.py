"""A user who can write neither the installation nor a home, as in containers and services."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from facade_core.core import numba_cache

NOBODY = 65534
# The interpreter may lie in a home that only root reads: the user may read everything, and write only what is its own.
BECOME_NOBODY = [
    "setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups",
    "--inh-caps=-all,+dac_read_search", "--ambient-caps=-all,+dac_read_search",
]  # fmt: skip
BLOCK = {
    "name": "tiny",
    "crs": "EPSG:3067",
    "buildings": {"path": "buildings.geojson", "crs": "EPSG:3067"},
    "streets": {"path": "streets.geojson", "crs": "EPSG:3067"},
    "texture": {"walls": "translate", "texels_per_metre": 4, "panorama_width": 256},
}


def write_features(path: Path, kind: str, coordinates: object, **tags: object) -> None:
    feature = {"type": "Feature", "properties": tags, "geometry": {"type": kind, "coordinates": coordinates}}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder of that user with a block, and the compiled kernels in its temporary folder."""
    if os.geteuid() != 0 or shutil.which("setpriv") is None or subprocess.run([*BECOME_NOBODY, "true"]).returncode:
        pytest.skip("no other user can be taken here")
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:  # only root may enter the folders of pytest
        yield write_place(Path(folder))


def write_place(folder: Path) -> Path:
    """Write the block and the kernels into a folder, and give it to the user."""
    ring = [[385_000 + x, 6_671_000 + y] for x, y in ((0, 0), (9, 0), (9, 9), (0, 9), (0, 0))]
    write_features(folder / "buildings.geojson", "Polygon", [ring], id="a", height=9)
    write_features(
        folder / "streets.geojson",
        "LineString",
        [[384_995, 6_670_993], [385_014, 6_670_993]],
        id="s",
        highway="residential",
    )
    (folder / "block.yaml").write_text(yaml.safe_dump(BLOCK))
    (folder / "temporary").mkdir()
    if numba_cache.CACHE_FOLDER is not None:  # compiled anew they take minutes
        kernels = folder / "temporary" / f"streetloom-kernels-{NOBODY}"
        shutil.copytree(numba_cache.CACHE_FOLDER, kernels / numba_cache._INSTALLATION)
        kernels.chmod(0o700)
    for path in (folder, *folder.rglob("*")):
        os.chown(path, NOBODY, NOBODY)
    return folder


def run_as_nobody(place: Path, *command: str, home: bool = True) -> subprocess.CompletedProcess[str]:
    """Run a command in an empty environment, with a home that does not exist or without any."""
    variables = [f"PATH={os.environ['PATH']}", f"TMPDIR={place / 'temporary'}", "STREETLOOM_DATA="]
    variables += ["HOME=/nonexistent"] if home else []
    whole = [*BECOME_NOBODY, "env", "-i", *variables, sys.executable, "-B", "-m", *command]
    return subprocess.run(whole, cwd=Path(__file__).parents[2], text=True, capture_output=True, timeout=1200)


@pytest.mark.parametrize("home", [True, False])
def test_help_is_shown_without_a_home(place: Path, home: bool) -> None:
    done = run_as_nobody(place, "flows", "--help", home=home)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Texture a block." in done.stdout


@pytest.mark.long
def test_a_block_is_planned_run_and_queried(place: Path) -> None:
    block, out = str(place / "block.yaml"), str(place / "out")
    planned = run_as_nobody(place, "flows", "plan", block)
    assert planned.returncode == 0, planned.stderr
    assert planned.stdout.startswith("tiny: one block, ")
    done = run_as_nobody(place, "flows", "run", block, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "telemetry" not in done.stderr  # of onnxruntime, which would send usage data
    asked = run_as_nobody(place, "flows", "query", out, "--where", "status = 'done'", "--format", "json")
    assert json.loads(asked.stdout), asked.stderr
    assert not Path("/nonexistent").exists()


def test_the_folder_of_a_bucket_run_is_a_private_temporary_one(place: Path) -> None:
    code = "from catalogs.published import folders; print(folders.local_run_folder(folders.S3Path('bucket/mine')))"
    for home in (True, False):
        variables = [f"TMPDIR={place / 'temporary'}", *(["HOME=/nonexistent"] if home else [])]
        whole = [*BECOME_NOBODY, "env", "-i", *variables, sys.executable, "-c", code]
        done = subprocess.run(whole, cwd=Path(__file__).parents[2], text=True, capture_output=True, check=True)
        found = Path(done.stdout.strip())
        assert found.is_relative_to(place / "temporary" / f"streetloom-cache-{NOBODY}")
        assert (place / "temporary" / f"streetloom-cache-{NOBODY}").stat().st_mode & 0o777 == 0o700
