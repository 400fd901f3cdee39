"""What a user types and sees when it goes wrong: one line, a code, no traceback."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from tasks.export.registry import FORMATS

ROOT = Path(__file__).resolve().parents[3]


def streetloom(*arguments: str, timeout: int = 120) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "flows", *arguments], cwd=ROOT, capture_output=True, text=True, timeout=timeout
    )


@pytest.mark.parametrize("command", [(), ("run",), ("demo",), ("query",), ("train",), ("train", "parser"), ("bench",)])
def test_help_has_an_example(command: tuple[str, ...]) -> None:
    shown = streetloom(*command, "--help")
    assert shown.returncode == 0
    assert "Example" in shown.stdout
    assert "streetloom" in shown.stdout


def test_help_imports_nothing_heavy() -> None:
    heavy = ("prefect", "numpy", "dask", "zarr", "rich")
    code = f"import sys, flows.cli.commands; print([m for m in {heavy} if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert shown.stdout.strip() == "[]"


def one_line_and_code_2(result: subprocess.CompletedProcess) -> str:
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    return result.stderr


def test_a_python_without_checks_is_refused() -> None:
    code = [sys.executable, "-O", "-m", "flows", "--help"]
    ended = subprocess.run(code, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == "streetloom: Python's -O and PYTHONOPTIMIZE leave out checks; run it without them\n"


def test_unknown_key_names_file_and_key(tmp_path: Path) -> None:
    block = tmp_path / "bad.yaml"
    block.write_text("name: x\nbuildigs: {path: a.pbf}\n")
    message = one_line_and_code_2(streetloom("run", str(block), "--out", str(tmp_path / "out")))
    assert "bad.yaml" in message
    assert "buildigs" in message
    assert len(message.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_missing_block_file(tmp_path: Path) -> None:
    assert "nothing.yaml" in one_line_and_code_2(streetloom("run", str(tmp_path / "nothing.yaml")))


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    message = one_line_and_code_2(streetloom("demo", "--out", str(tmp_path / "file" / "out")))
    assert "cannot be written" in message
    assert "--out" in message


def test_query_of_nothing(tmp_path: Path) -> None:
    message = one_line_and_code_2(streetloom("query", str(tmp_path)))
    assert "streetloom run" in message
    assert len(message.strip().splitlines()) == 1


def test_a_benchmark_has_help_of_its_own() -> None:
    shown = streetloom("bench", "query", "--help")
    assert shown.returncode == 0
    assert "--rows ROWS" in shown.stdout


def test_benchmarks_are_listed_with_what_they_measure() -> None:
    shown = streetloom("bench")
    assert shown.returncode == 0
    about = dict(line.split(maxsplit=1) for line in shown.stdout.splitlines())
    assert about["elements"] == "How far what is told of facades can be trusted"
    assert not any("prints" in said for said in about.values())


@pytest.mark.long
def test_view_names_the_runs_of_a_folder_where_one_is_needed(tmp_path: Path) -> None:
    for name in ("b", "north/a", "b/store/inner"):
        (tmp_path / name / "store").mkdir(parents=True)
    message = one_line_and_code_2(streetloom("view", str(tmp_path), "--edit", "--photos", str(tmp_path)))
    assert f"holds 2 runs (b, north/a); open one: streetloom view {tmp_path / 'b'}" in message
    message = one_line_and_code_2(streetloom("view", str(tmp_path / "north" / "a" / "store")))
    assert "no run has written here" in message


@pytest.mark.long
def test_view_says_that_a_run_has_just_begun(tmp_path: Path) -> None:
    from flows.lock import lock_folder

    with lock_folder(tmp_path / "north"):
        for folder in (tmp_path, tmp_path / "north"):
            message = one_line_and_code_2(streetloom("view", str(folder)))
            assert f"{tmp_path / 'north'}: a run has just begun here and has no store yet; wait" in message
            assert len(message.splitlines()) == 1
    assert "no run has written here" in one_line_and_code_2(streetloom("view", str(tmp_path / "north")))


def test_unknown_benchmark_names_those_there_are() -> None:
    message = one_line_and_code_2(streetloom("bench", "speed"))
    assert "camera_walls" in message


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "BLOCK", "--out", ""), "--out: is empty; name a folder"),
        (("view", "FOLDER", "--host", ""), "--host: is empty; name an address"),
    ],
)
def test_a_variable_of_a_script_that_is_not_set_opens_nothing(
    tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    from click.testing import CliRunner

    from flows.cli.commands import command_line

    (tmp_path / "block.yaml").write_text("")
    given = {"BLOCK": str(tmp_path / "block.yaml"), "FOLDER": str(tmp_path)}
    shown = CliRunner().invoke(command_line, [given.get(word, word) for word in arguments])
    assert shown.exit_code == 2
    assert said in shown.stderr
    assert len(shown.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "give a map as --osm"),
        (("--osm", "MAP", "--streets", "MAP"), "--osm holds buildings and streets"),
        (("--osm", "MAP"), "is no .osm.pbf; give it as --buildings '"),
        (("--buildings", "MAP", "--bbox", "1", "2", "3", "4", "--around", "1", "2"), "--bbox or --around"),
        (("--buildings", "MAP", "--size", "5"), "--size"),
    ],
)
def test_a_new_block_is_of_one_map_and_one_place(tmp_path: Path, options: tuple[str, ...], said: str) -> None:
    from flows.cli.commands import command_line

    (tmp_path / "my city.gpkg").write_bytes(b"")
    given = [str(tmp_path / "my city.gpkg") if word == "MAP" else word for word in options]
    shown = CliRunner().invoke(command_line, ["new-block", str(tmp_path / "new.yaml"), *given])
    assert shown.exit_code == 2
    assert said in shown.stderr
    assert len(shown.stderr.splitlines()) == 1
    assert not (tmp_path / "new.yaml").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "BLOCK", "--out", "gs://bucket/out"),
        ("demo", "--out", "gs://bucket/out"),
        ("fetch", "delfshaven", "--out", "s3://bucket"),
        ("export", "FOLDER", "--format", "glb", "--to", "s3://bucket/x"),
        ("new-block", "s3://bucket/x.yaml", "--osm", "BLOCK", "--bbox", "1", "2", "3", "4"),
    ],
)
def test_results_go_to_folders_of_this_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    from click.testing import CliRunner

    from flows.cli.commands import command_line

    (tmp_path / "block.yaml").write_text("")
    given = {"BLOCK": str(tmp_path / "block.yaml"), "FOLDER": str(tmp_path)}
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    shown = CliRunner().invoke(command_line, [given.get(word, word) for word in arguments])
    assert list(Path.cwd().iterdir()) == []
    assert shown.exit_code == 2
    assert "is written to folders of this machine only" in shown.stderr
    assert len(shown.stderr.splitlines()) == 1


def test_what_asks_before_the_server_is_there_imports_no_prefect() -> None:
    """Prefect reads where its server is when it is first imported; a redo once made it look for one of its own."""
    modules = "catalogs.block, flows.run_entry, flows.lock, flows.log_file, flows.server.startup"
    modules += ", tasks.stages.streets.redo, tasks.engine.run, tasks.engine.store.status"
    code = f"import sys, flows.cli.commands, flows.console, {modules}; print('prefect' in sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert shown.stdout.strip() == "False", shown.stderr


def test_a_crash_is_one_line_and_code_70(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from click.testing import CliRunner

    from flows.cli.commands import command_line

    def crash(*_: object) -> None:
        raise KeyError("inner")

    monkeypatch.setattr("flows.run_entry.read_block", crash)
    (tmp_path / "block.yaml").write_text("")
    shown = CliRunner().invoke(command_line, ["run", str(tmp_path / "block.yaml"), "--out", str(tmp_path / "out")])
    assert shown.exit_code == 70
    (line,) = shown.stderr.splitlines()
    told, _, log = line.rpartition(" ")
    assert told == "streetloom: stopped by an error of its own (KeyError: 'inner'); where is in"
    assert "in crash" in Path(log).read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--worker",), "no such option --worker (streetloom --help)"),
        (("rn",), "no such command rn; did you mean run? (streetloom --help)"),
        (
            ("run", "BLOCK", "--worker", "2"),
            "run: no such option --worker; did you mean --workers? (streetloom run --help)",
        ),
        (("run", "BLOCK", "-x"), "run: no such option -x (streetloom run --help)"),
        (("run",), "run: missing argument 'BLOCK.yaml' (streetloom run --help)"),
        (("run", "BLOCK", "more"), "run: got unexpected extra argument (more) (streetloom run --help)"),
        (("run", "BLOCK", "--out"), "run: option '--out' requires an argument (streetloom run --help)"),
        (
            ("run", "BLOCK", "--workers", "two\n\x1b[2J"),
            "run: invalid value for '--workers': 'two\\n\\x1b[2J' is no whole number (streetloom run --help)",
        ),
        (
            ("demo", "--workers", "0"),
            "demo: invalid value for '--workers': 0 is not in the range 1<=x<=256 (streetloom demo --help)",
        ),
        (
            ("export", "FOLDER", "--format", "3dtiles", "--max-texture-mb", "abc"),
            "export: invalid value for '--max-texture-mb': 'abc' is no number (streetloom export --help)",
        ),
        (
            ("export", "FOLDER", "--format", "gltf"),
            f"export: invalid value for '--format': 'gltf' is not one of {', '.join(map(repr, FORMATS))}; did you mean glb? "
            "(streetloom export --help)",
        ),
        (
            ("new-block", "NEW", "--size", "0.2"),
            "new-block: invalid value for '--size': 0.2 is not in the range 50.0<=x<=5000.0 metres "
            "(streetloom new-block --help)",
        ),
        (
            ("new-block", "NEW", "--around", "4,8202", "45.764"),
            "new-block: invalid value for '--around': '4,8202' is no number; write a decimal point: 4.8202 "
            "(streetloom new-block --help)",
        ),
        (("prune", "FOLDER"), "prune: missing option '--keep' (streetloom prune --help)"),
        (("train", "parsr"), "train: no such command parsr; did you mean parser? (streetloom train --help)"),
        (
            ("train", "parser", "--data", "FOLDER", "--out", "FOLDER", "--fold", "tree"),
            "train parser: invalid value for '--fold': 'tree' is not one of 'artdeco', 'ruemonge2014' "
            "(streetloom train parser --help)",
        ),
    ],
)
def test_a_slip_of_the_command_line_is_one_line(tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    from click.testing import CliRunner

    from flows.cli.commands import command_line

    (tmp_path / "block.yaml").write_text("")
    given = {"BLOCK": str(tmp_path / "block.yaml"), "FOLDER": str(tmp_path)}
    shown = CliRunner().invoke(command_line, [given.get(word, word) for word in arguments])
    assert (shown.exit_code, shown.stdout) == (2, "")
    assert shown.stderr == f"streetloom: {said}\n"


@pytest.mark.parametrize(
    ("arguments", "near"),
    [
        (("run", "blok.yaml"), "block.yaml"),
        (("import", "out/dmo", "block.yaml"), "out/demo"),
        (("import", "out/demo", "blck.yaml"), "block.yaml"),
        (("query", "out/dmo"), "out/demo"),
        (("run", "xyzzy"), None),
        (("run", "nope.yaml"), None),
    ],
)
def test_a_path_that_is_not_there_is_told_with_what_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], near: str | None
) -> None:
    from flows.cli.commands import command_line

    (tmp_path / "block.yaml").write_text("")
    (tmp_path / "e.yaml").write_text("")
    (tmp_path / "out" / "demo").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    shown = CliRunner().invoke(command_line, list(arguments))
    assert shown.exit_code == 2
    (line,) = shown.stderr.splitlines()
    assert "does not exist" in line
    assert (f"; did you mean {near}?" in line) if near else ("did you mean" not in line)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("view", "b/b.yaml"), "'OUT': b/b.yaml is a file; name a folder of results such as out/b"),
        (("query", "b/b.yaml"), "'FOLDER': b/b.yaml is a file; name a folder of results such as out/b"),
        (("query", "b/a.txt"), "'FOLDER': b/a.txt is a file; name a folder of results such as out/demo"),
        (("run", "b"), "'BLOCK.yaml': b is a folder; name a block file such as b/b.yaml"),
        (("run", "empty"), "'BLOCK.yaml': empty is a folder; name a block file"),
        (("city", "cities"), "'CITY.yaml': cities is a folder; name a city file such as cities/first.yaml"),
        (("new-block", "n.yaml", "--buildings", "b"), "'--buildings': b is a folder; name a file in it"),
        (("new-block", "n.yaml", "--photos", "b/a.txt"), "'--photos': b/a.txt is a file; name a folder"),
    ],
)
def test_a_file_for_a_folder_is_told_with_what_is_expected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str
) -> None:
    for name in ("b/a.txt", "b/a.yaml", "b/b.yaml", "cities/first.yaml", "cities/second.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    shown = CliRunner().invoke(command_line, list(arguments))
    assert shown.exit_code == 2
    command = arguments[0]
    assert shown.stderr == f"streetloom: {command}: invalid value for {said} (streetloom {command} --help)\n"


def test_every_command_refuses_an_unknown_option_in_one_line() -> None:
    import click
    from click.testing import CliRunner

    from flows.cli.commands import command_line

    def commands(group: click.Group, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        for name, command in group.commands.items():
            yield (*path, name)
            if isinstance(command, click.Group):
                yield from commands(command, (*path, name))

    known = [path for path in commands(command_line, ()) if path != ("bench",)]  # a benchmark's options are its own
    assert len(known) > 10
    for path in known:
        shown = CliRunner().invoke(command_line, [*path, "--xyzzy"])
        assert shown.exit_code == 2
        assert (
            shown.stderr
            == f"streetloom: {' '.join(path)}: no such option --xyzzy (streetloom {' '.join(path)} --help)\n"
        )


def test_a_group_without_a_command_shows_its_help() -> None:
    from click.testing import CliRunner

    from flows.cli.commands import command_line

    for group, heading in (((), "Begin:"), (("train",), "Commands:")):
        assert heading in CliRunner().invoke(command_line, list(group)).stderr


def test_the_help_lists_each_command_once_and_whole() -> None:
    from click.testing import CliRunner

    from flows.cli.commands import COMMAND_GROUPS, command_line

    assert sorted(name for names in COMMAND_GROUPS.values() for name in names) == sorted(command_line.commands)
    assert "..." not in CliRunner().invoke(command_line, ["--help"]).output.partition("Begin:")[2]


def test_of_several_conditions_all_must_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str | None] = []

    def find(folder: str, *, where: str | None, **more: object) -> None:
        asked.append(where)
        raise InputError("asked")

    monkeypatch.setattr("catalogs.query.execution.query", find)
    for more in ([], ["--where", "a or b"], ["--where", "a or b", "--where", "c"]):
        CliRunner().invoke(command_line, ["query", str(tmp_path), *more])
    assert asked == [None, "a or b", "(a or b\n) AND (c\n)"]
