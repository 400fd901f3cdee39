"""Units depend on their inputs, and on all of them: what they open stands there, and what stands there is read."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from tests.pipeline.runs import ROOT, environment

# An input that is not read is not in the key: its change would leave the result as it is. The block has no panoramas and
# no textures of its own.
NOT_READ = {
    "facades": ["between", "captured", "exposure_factors", "own"],
    "streets": ["materials", "pictured_ground", "seed", "view"],
}

# Arrays of the atlas whose digests are in the inputs. Of pictures, the facade's key covers all but atlas/provenance, on which
# only a picture depends that the report does not show.
DIGESTED = {
    "compute_surface": [
        "atlas/seed",
        "atlas/seed_evidence",
        "facade_maps/labels",
    ],
    "compute_page": ["atlas/colour"],
    "compute_tile": ["atlas/colour"],
    "compute_pictures": [
        "atlas/provenance",
        "atlas/seed",
        "facade_maps/evidence",
        "facade_maps/labels",
        "facade_maps/occluded",
    ],
}


@pytest.fixture(scope="module")
def observed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("guarded")
    command = [sys.executable, "-m", "tests.tasks.stages.guarded_run", str(folder)]
    done = subprocess.run(command, cwd=ROOT, env=environment(folder), capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def test_no_unit_opens_a_file_that_its_inputs_do_not_name(observed: Any) -> None:
    assert observed["elsewhere"] == {}
    assert observed["named"]["texture_from_pictures"] == ["a-0.png"], "an opened file is recorded"
    assert {"prepare_picture", "compute_surface", "compute_page", "compute_tile", "compute_pictures"} <= observed[
        "named"
    ].keys()


def test_every_input_is_read(observed: Any) -> None:
    assert {stage: names for stage, names in observed["unread"].items() if names} == NOT_READ


def test_no_unit_reads_an_array_that_its_inputs_do_not_digest(observed: Any) -> None:
    assert {name: arrays for name, arrays in observed["arrays"].items() if arrays} == DIGESTED
