"""The page as files: whose files stay, which blocks are left out, what is not published, and the names of its files."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from catalogs.published.snapshot import snapshot_folder
from facade_core.core.errors import FacadeError, InputError
from flows.viewer.app import PAGE_FOLDER
from flows.viewer.model import block_tileset, find_model_file
from flows.viewer.static_page import LIST_NAME, StaticPageWriter, hash_value

LONG_IDS = ("w" * 300, "д" * 56, "街" * 32, "..", "a/b")
SECRET = "/home/someone/photos"


def application(ids: tuple[str, ...] = ("w1",), blocks: int = 1, without_model: tuple[int, ...] = ()) -> Starlette:
    """What the viewer answers of a city, of which some blocks have no model."""

    def city(request: Request) -> Response:
        listed = [
            {"number": n, "name": f"b{n}", "title": "", "published": "S", "reason": SECRET} for n in range(blocks)
        ]
        return JSONResponse({"single": False, "blocks": listed, "notes": [SECRET]})

    def answer(request: Request) -> Response:
        number, path = int(request.path_params["number"]), request.path_params["path"]
        facades = [{"id": id, "reason": SECRET} for id in ids]
        stages = [{"stage": "source"}, {"stage": "seams"}]
        answers: dict[str, Any] = {
            "api/block": {"facades": facades, "notes": [SECRET]},
            "api/progress": {"failures": [{"unit": "w1", "reason": SECRET}]},
            "api/start": {},
            "api/facade": {"stages": stages, "change": {"before": True}, "reason": SECRET},
            "tiles/S/tileset.json": {"root": {"content": {"uri": "overview.glb"}}},
        }
        if number in without_model and path.startswith("tiles/"):
            return JSONResponse({"reason": "the model has no tiles"}, 503)
        return JSONResponse(answers[path]) if path in answers else Response(b"picture")

    return Starlette(routes=[Route("/api/city", city), Route("/blocks/{number:int}/{path:path}", answer)])


def write(folder: Path, app: Starlette | None = None) -> list[str]:
    said: list[str] = []
    count = StaticPageWriter(app or application(), folder, said.append).write()
    assert count == len(json.loads((folder / LIST_NAME).read_text()))
    return said


def test_other_files_stay_and_former_ones_go(tmp_path: Path) -> None:
    site = tmp_path / "site"
    write(site, application(blocks=2))
    for name in (".git/config", "CNAME", "blocks/1/of-others.txt"):
        (site / name).parent.mkdir(exist_ok=True)
        (site / name).touch()
    write(site)
    assert (site / ".git" / "config").is_file()
    assert (site / "CNAME").is_file()
    assert [path.name for path in (site / "blocks" / "1").iterdir()] == ["of-others.txt"]
    listed = json.loads((site / LIST_NAME).read_text())
    assert "index.html" in listed
    assert all((site / name).is_file() for name in listed)
    assert not any(name.startswith("blocks/1/") for name in listed)


@pytest.mark.parametrize("name", ["CNAME", "index.html", LIST_NAME])
def test_a_folder_of_others_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes('{"a": "caf\xe9"}'.encode("latin-1"))
    with pytest.raises(FacadeError) as refused:
        StaticPageWriter(application(), tmp_path, print)
    assert str(tmp_path) in str(refused.value)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_page_that_fails_leaves_the_earlier_one(tmp_path: Path) -> None:
    write(tmp_path / "site")
    before = sorted((tmp_path / "site").rglob("*"))
    with pytest.raises(InputError, match="no block has a model"):
        write(tmp_path / "site", application(without_model=(0,)))
    assert sorted((tmp_path / "site").rglob("*")) == before


def test_nothing_outside_the_folder_is_touched(tmp_path: Path) -> None:
    (tmp_path / "kept").touch()
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / LIST_NAME).write_text('["../kept"]')
    with pytest.raises(InputError, match="outside"):
        write(tmp_path / "site")
    assert (tmp_path / "kept").exists()
    assert [path.name for path in (tmp_path / "site").iterdir()] == [LIST_NAME]
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    write(tmp_path / "link")
    write(tmp_path / "link")
    assert (tmp_path / "elsewhere" / "index.html").is_file()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(OSError, match="loop"):
        write(tmp_path / "loop")


def test_a_block_without_a_model_is_left_out(tmp_path: Path) -> None:
    said = write(tmp_path, application(blocks=3, without_model=(1,)))
    assert [line.split(":")[0] for line in said] == ["b0", "b1", "b2"]
    assert said[1] == "b1: left out: blocks/1/tiles/S/tileset.json: the model has no tiles"
    assert [one["number"] for one in json.loads((tmp_path / "api" / "city.json").read_text())["blocks"]] == [0, 2]
    assert not (tmp_path / "blocks" / "1").exists()


def test_no_reason_and_no_note_is_published(tmp_path: Path) -> None:
    write(tmp_path)
    texts = [path.read_text() for path in tmp_path.rglob("*.json")]
    assert len(texts) > 4
    assert not any(SECRET in text for text in texts)
    html = (tmp_path / "index.html").read_text()
    policy = html.index('http-equiv="Content-Security-Policy"')
    assert policy < html.index("<link")
    assert "default-src 'none'; script-src 'self'" in html
    assert "frame-ancestors" not in html


@pytest.fixture
def script(tmp_path: Path) -> Any:
    """What an expression over the page's scripts yields in node."""
    if shutil.which("node") is None:
        pytest.skip("no node on this machine")
    for file in PAGE_FOLDER.glob("*.js"):
        shutil.copy(file, tmp_path)
    (tmp_path / "package.json").write_text('{"type": "module"}')

    def evaluate(module: str, expression: str) -> Any:
        code = f"""globalThis.document = {{querySelector: () => ({{}})}};
            const page = await import("./{module}"); console.log(JSON.stringify({expression}));"""
        (tmp_path / "asked.js").write_text(code)
        done = subprocess.run(["node", "asked.js"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return evaluate


def test_ids_of_any_length_have_the_files_that_the_page_asks_for(script: Any, tmp_path: Path) -> None:
    site = tmp_path / "site"
    write(site, application(LONG_IDS))
    asked = script(
        "elements.js", f"{json.dumps(LONG_IDS)}.map((id) => page.picture(id, 'source', 'S', 80, 'blocks/0/'))"
    )
    assert asked == [f"blocks/0/picture/facade/{hash_value(id)}/{hash_value('source')}.webp" for id in LONG_IDS]
    assert all((site / address).read_bytes() == b"picture" for address in asked)
    assert not (site / "blocks/0/picture/facade" / hash_value("w" * 300) / f"{hash_value('seams')}.webp").exists()


def test_sides_of_a_street_with_a_corner(script: Any) -> None:
    # east, then north; a chord from end to end would put the wall inside of the corner's far arm on its other side
    street = {"id": "s1", "line": [[0, 0], [100, 0], [100, 100]]}
    walls = {"north": (50, 8), "south": (50, -8), "outer": (108, -8), "west": (92, 60), "east": (108, 60)}
    facades = [
        {"id": id, "role": "street", "street_id": "s1", "street": "Main", "line": [[x - 1, y], [x + 1, y]]}
        for id, (x, y) in walls.items()
    ]
    other = [facades[0] | {"id": "other", "street_id": "s2"}]
    block = {"facades": facades[::-1] + other}
    found = script(
        "elevations.js",
        f"page.sides({json.dumps(block)}, {json.dumps(street)}).map((side) => side.map(({{id}}) => id))",
    )
    assert found == [["north", "west"], ["east", "outer", "south"]]


def test_titles_are_written_out(script: Any) -> None:
    made = """(() => { const told = {};
        document.createElement = () => ({append() {}, setAttribute(name, value) { told[name] = value; }});
        page.element("a", {title: "a\\u202eb", "aria-label": "c\\u2066", href: "d\\u202e"}); return told; })()"""
    assert script("elements.js", made) == {"title": "a\\u202eb", "aria-label": "c\\u2066", "href": "d\u202e"}


def test_tiles_are_below_their_folder(tmp_path: Path) -> None:
    snapshot = snapshot_folder(tmp_path, "S")
    snapshot.tiles.parent.mkdir(parents=True)
    snapshot.summary.write_text("{}")
    (tmp_path / "current").write_text("S")
    (tmp_path / "evil.glb").touch()
    for path, taken in (("375_-6514_012", True), ("1_2", True), ("../../../evil", False), (os.fspath(tmp_path), False)):
        snapshot.tiles.write_text(json.dumps({"tiles": [{"path": path, "box": [[0, 0, 0], [1, 1, 1]]}]}))
        if taken:
            [child] = block_tileset(tmp_path, "S")["root"]["children"]
            assert child["content"]["uri"] == f"{path}.glb"
        else:
            with pytest.raises(InputError, match="is no tile"):
                block_tileset(tmp_path, "S")
            with pytest.raises(InputError, match="is no tile"):
                find_model_file(tmp_path, "S", f"{path}.glb")
