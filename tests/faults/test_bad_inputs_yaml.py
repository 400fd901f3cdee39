"""Slips of a block file: each is one line that names the file, the line or key, and the remedy; nothing is read as what it is
not."""

from __future__ import annotations

import json
import os
import random
from pathlib import Path
from typing import Any

import pytest

from catalogs.block.declared_keys import declared_keys
from catalogs.block.key_faults import validate_block_settings
from catalogs.block.keys import BlockFileSettings
from catalogs.block.reader import read_block
from catalogs.block.yaml_files import MAX_FILE_BYTES, read_yaml
from facade_core.core.errors import BlockFileError, InputError

EAST, NORTH = 385_000.0, 6_671_000.0


def tiny(folder: Path, text: str | bytes) -> Path:
    """A block file beside a building and a street."""
    ring = [[EAST + x, NORTH + y] for x, y in ((0, 0), (12, 0), (12, 8), (0, 8), (0, 0))]
    shapes = {
        "buildings": {"type": "Polygon", "coordinates": [ring]},
        "streets": {"type": "LineString", "coordinates": [[EAST - 5, NORTH - 5], [EAST + 20, NORTH - 5]]},
    }
    for name, geometry in shapes.items():
        feature = {"type": "Feature", "properties": {"id": name, "height": 9.0}, "geometry": geometry}
        (folder / f"{name}.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    file = folder / "block.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    return file


GOOD = """name: tiny
crs: EPSG:32635
buildings: {path: buildings.geojson, crs: "EPSG:32635"}
streets: {path: streets.geojson, crs: "EPSG:32635"}
texture: {walls: translate}
seed: 3
"""
# What the file holds -> what is said of it.
REFUSED: dict[str, tuple[str | bytes, str]] = {
    "octal": (GOOD.replace("seed: 3", "seed: 010"), r"line 6: 010 begins with 0, .*; write 10"),
    "minus-octal": (GOOD.replace("seed: 3", "seed: -017"), r"line 6: -017 begins .*; write -17"),
    "sexagesimal": (
        GOOD.replace("seed: 3", "seed: 1:30"),
        r"seed: '1:30' is not a whole number, 0 to 4294967295; write it in digits",
    ),
    "underscores": (GOOD.replace("seed: 3", "seed: 1_000"), r"seed: '1_000' is not a whole number"),
    "binary-number": (GOOD.replace("seed: 3", "seed: 0b11"), r"seed: '0b11' is not a whole number"),
    "seed-yes": (GOOD.replace("seed: 3", "seed: yes"), r"seed: 'yes' is not a whole number"),
    "seed-date": (GOOD.replace("seed: 3", "seed: 2024-01-01"), r"seed: '2024-01-01' is not a whole number"),
    "seed-fraction": (GOOD.replace("seed: 3", "seed: 1.5"), r"seed: 1.5 is not a whole number"),
    "seed-minus": (GOOD.replace("seed: 3", "seed: -1"), r"seed: -1 is not a whole number, 0 to 4294967295$"),
    "seed-2-to-64": (
        GOOD.replace("seed: 3", f"seed: {2**64}"),
        r"seed: 18446744073709551616 is not a whole number, 0 to",
    ),
    "seed-5000-digits": (GOOD.replace("seed: 3", "seed: " + "9" * 5000), r"line 6: a number of 5000 digits"),
    "seed-nan": (GOOD.replace("seed: 3", "seed: .nan"), r"seed: nan is not a whole number"),
    "name-octal": (GOOD.replace("tiny", "007"), r"line 1: 007 begins with 0.*in quotes where it is text"),
    "name-number": (GOOD.replace("tiny", "7"), r"name: 7 is not text; write it in quotes"),
    "name-true": (GOOD.replace("tiny", "true"), r"name: True is not text; write it in quotes"),
    "name-empty": (GOOD.replace("tiny", ""), r"name: is empty; fill it in"),
    "name-path": (GOOD.replace("tiny", "../x"), r"name: use letters, digits, .*, such as x, got '\.\./x'"),
    "name-list": (GOOD.replace("tiny", "[a]"), r"name: \['a'\]: Input should be a valid string; write a text"),
    "name-long": (GOOD.replace("tiny", "n" * 300), r"name: use letters, .*, 80 at most, such as nnn"),
    "levelling-yes": (GOOD.replace("walls: translate", "levelling: yes"), r"texture.levelling: 'yes' is not true or"),
    "levelling-1": (GOOD.replace("walls: translate", "levelling: 1"), r"texture.levelling: 1 is not true or false"),
    "storey-feet": (GOOD + "storey: 10 ft\n", r"storey: '10 ft' is not a number"),
    "storey-inf": (GOOD + "storey: .inf\n", r"storey: inf is not a number, 2 to 8$"),
    "storey-1e999": (GOOD + "storey: 1e999\n", r"storey: inf is not a number, 2 to 8$"),
    "storey-comma": (GOOD + "storey: 3,2\n", r"storey: '3,2' is not a number"),
    "area-nan": (GOOD + "area: [.nan, .nan, .nan, .nan]\n", r"area: must be \[west, south, east, north\]"),
    "area-three": (
        GOOD + "area: [1, 2, 3]\n",
        r"area: \[1, 2, 3\]: List should have at least 4 items .*; write a list of 4 numbers$",
    ),
    "area-huge": (GOOD + "area: [1e300, 1, 2, 3]\n", r"area: must be \[west"),
    "area-swapped": (GOOD + "area: [2, 1, 1, 2]\n", r"area: must be \[west"),
    "offset-nan": (
        GOOD.replace("path: b", "offset: [.nan, 0, 0], path: b"),
        r"buildings.offset\[0\]: nan: Input should be a finite",
    ),
    "offset-huge": (
        GOOD.replace("path: b", "offset: [0, 1e300, 0], path: b"),
        r"buildings.offset\[1\]: 1e\+300: Input should be less",
    ),
    "offset-text": (
        GOOD.replace("path: b", "offset: [0, 0, up], path: b"),
        r"buildings.offset\[2\]: 'up': Input should be a valid num",
    ),
    "alias": (GOOD + "terrain: &a {path: x}\nimagery: {aerial: *a}\n", r"line 7: &a names a value; leave the name out"),
    "alias-alone": (GOOD + "terrain: *a\n", r"line 7: \*a stands for another value; write the value out"),
    "laughs": (
        "a: &a [x, x]\n" + "".join(f"{b}: &{b} [*{a}, *{a}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)),
        r"line 1: &a names a value",
    ),
    "merge": (GOOD + "<<: {seed: 4}\n", r"<<: unknown key"),
    "tag": (GOOD.replace("seed: 3", "seed: !!str 3"), r"line 6: '!!str' is a tag, and tags are not read"),
    "tag-python": (GOOD.replace("seed: 3", "seed: !!python/name:os.system x"), r"line 6: '!!python/name:os.system' is"),
    "tag-own": (GOOD.replace("seed: 3", "seed: !x 3"), r"line 6: '!x' is a tag"),
    "deep-list": ("name: " + "[" * 3000, r"line 1: more than 20 levels"),
    "deep-keys": ("".join(f"{' ' * i}a:\n" for i in range(200)), r"line 21: more than 20 levels"),
    "twice": (
        GOOD + "seed: 4\n",
        r'line 7, column 1: found duplicate key "seed" with value "4" \(original value: "3"\); keep one, with',
    ),
    "twice-inside": (
        GOOD.replace("walls: translate", "walls: translate, walls: translate"),
        r'line 5, .*: found duplicate key "walls"',
    ),
    "twice-keys": (
        GOOD + "imagery: {photos: {path: .}}\nimagery: {exemplars: {path: .}}\n",
        r'line 8, .*: found duplicate key "imagery"; keep one, with the keys of both$',
    ),
    "twice-one-empty": (GOOD + "imagery:\nimagery: {exemplars: {path: .}}\n", r"found duplicate key"),
    "joined": (
        GOOD.replace("walls: translate", "texels_per_metre:8"),
        r"texture.texels_per_metre:8 needs a space after the colon; write texels_per_metre: 8$",
    ),
    "joined-alone": (
        GOOD.replace("{walls: translate}", "\n  texels_per_metre:8"),
        r"texture: 'texels_per_metre:8' needs a space after the colon; write texels_per_metre: 8$",
    ),
    "joined-last": (GOOD.replace("seed: 3", "seed:3"), r"line 6: seed:3 needs a space after the colon; write seed: 3$"),
    "joined-first": (GOOD.replace("name: ", "name:"), r"line 1: name:tiny needs a space after the colon"),
    "list-for-key": (GOOD + "? [a]\n: 1\n", r"\('a',\): unknown key; known here are name"),
    "number-for-key": (GOOD + "7: 1\n", r"7: unknown key; known here are name"),
    "long-key": (GOOD + "k" * 900 + ": 1\n", r"kkk\.\.\.: unknown key"),
    "mistyped": (GOOD + "sead: 1\n", r"block.yaml: line 7: sead: unknown key; did you mean seed\?"),
    "nul": (GOOD.replace("tiny", '"a\\0b"'), r"line 1: 'a\\x00b' holds a control character; write it without"),
    "bell": (GOOD.replace("tiny", "\a"), r"line 1: not valid YAML \(special characters are not allowed\)"),
    "half-letter": (GOOD.replace("tiny", '"\\uD800"'), r"line 1: '\\ud800' holds half a character"),
    "half-letter-raw": (GOOD.replace("tiny", "\ud800"), r"is not UTF-8 text"),
    "newline": (GOOD.replace("buildings.geojson", '"a\\nb.geojson"'), r"line 3: 'a\\nb.geojson' holds a control char"),
    "separator": (GOOD.replace("tiny", "'a\u2028b'"), r"line 1: 'a\\u2028b' holds a line break"),
    "open-quote": (GOOD + "crs: 'x", r"line 7, column 8: not valid YAML"),
    "open-brace": ("name: {a: 1", r"line 1, column 12: not valid YAML"),
    "tab": (
        "\tname: a",
        r"line 1, column 1: not valid YAML \(found character '.{2}' that cannot start any token\); mend that line$",
    ),
    "two-documents": (GOOD + "---\n" + GOOD, r"line 7, column 1: not valid YAML \(but found another document\)"),
    "yaml-3": ("%YAML 3.0\n---\n" + GOOD, r"line 1, column 1: not valid YAML"),
    "empty": ("", r"holds no keys; write at least name"),
    "comment": ("# nothing\n", r"holds no keys"),
    "list": ("[name, tiny]", r"holds no keys"),
    "text": ("block", r"holds no keys"),
    "binary": (bytes(range(256)) * 8, r"is not UTF-8 text; a block file is YAML: save it as UTF-8$"),
    "zeros": (b"\0" * 64, r"line 1: not valid YAML \(special characters"),
    "utf-16": (GOOD.encode("utf-16"), r"is not UTF-8 text"),
    "utf-16-be": (GOOD.encode("utf-16-be"), r"line 1: not valid YAML \(special characters"),
    "latin-1": (GOOD.replace("tiny", "caf\xe9").encode("latin-1"), r"is not UTF-8 text"),
    "huge": (GOOD + "#" * MAX_FILE_BYTES, r"has more than 256 kB, and a block file only names data"),
    "path-tilde": (GOOD.replace("buildings.g", "~nosuchuser/b.g"), r"buildings.path: .*there is no user ~nosuchuser"),
    "path-long": (GOOD.replace("buildings.g", "b" * 400 + ".g"), r"buildings.path: .*cannot be opened \(File name too"),
    "path-longer": (GOOD.replace("buildings.g", "b/" * 3000 + ".g"), r"buildings.path: .* \(File name too long\)"),
    "path-folder": (GOOD.replace("buildings.geojson", "."), r"buildings.path: .* is a folder; name a file in it"),
    "path-device": (GOOD.replace("buildings.geojson", "/dev/null"), r"/dev/null is no file but a device; name a file"),
    "path-missing": (GOOD.replace("buildings.g", "building.g"), r"does not exist; did you mean buildings.geojson\?"),
    "path-below-file": (GOOD.replace("buildings.g", "block.yaml/b.g"), r"does not exist; paths are relative"),
    "path-empty": (GOOD.replace("path: buildings.geojson", "path: ''"), r"buildings.path: "),
    "path-circle": (GOOD.replace("buildings.geojson", "circle"), r"circle cannot be opened \(Too many levels of symb"),
    "path-variable": (GOOD.replace("buildings.geojson", "'${NO_SUCH_ONE}/b'"), r"variable NO_SUCH_ONE is not set"),
    "path-number": (
        GOOD.replace("path: buildings.geojson", "path: 3"),
        r"buildings.path: 3 is not a file or list of files",
    ),
    "path-null": (GOOD.replace("path: streets.geojson", "path: "), r"streets.path: is empty; fill it in"),
    "imagery-list": (GOOD + "imagery: [a]\n", r"imagery: holds \['a'\] where keys are expected"),
    "exemplars-text": (GOOD + "imagery: {exemplars: facades}\n", r"imagery.exemplars: holds .*write .*path: facades"),
    "exemplars-file": (GOOD + "imagery: {exemplars: {path: block.yaml}}\n", r"is not a folder; give the folder"),
    "walls-else": (GOOD.replace("translate", "both"), r"texture.walls: 'both' is not `exemplar` or `translate`$"),
    "width-odd": (GOOD.replace("walls", "panorama_width: 65, walls"), r"texture.panorama_width: must be even"),
    "width-huge": (
        GOOD.replace("walls", "panorama_width: 99999999, walls"),
        r"99999999 is not a whole number, 64 to 8192$",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_slip_in_a_block_file_is_one_line(case: str, tmp_path: Path) -> None:
    text, expected = REFUSED[case]
    (tmp_path / "circle").symlink_to("circle")
    file = tiny(tmp_path, text)
    with pytest.raises(BlockFileError, match=expected) as raised:
        read_block(file)
    message = str(raised.value)
    assert message.startswith(f"{file}: ")
    assert message.isprintable(), "one line that any terminal can show"
    assert len(message) < 700


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("no", "no"),
        ("on", "on"),
        ("1:30", "1:30"),
        ("2024-01-01", "2024-01-01"),
        ("=", "="),
        ("1e3", 1000.0),
        ("0o17", 15),
        ("0x1F", 31),
        ("0", 0),
        (".5", 0.5),
        ("012.5", 12.5),
        ("~", None),
        ("True", True),
        ("'010'", "010"),
    ],
)
def test_plain_values_are_those_of_yaml_1_2(text: str, value: Any, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"a: {text}")
    found = read_yaml(tmp_path / "a.yaml")["a"]
    assert (found, type(found)) == (value, type(value))


def test_what_is_no_file_is_not_read_for_ever(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "circle").symlink_to("circle")
    for path, problem in {
        tmp_path: "is no file",
        tmp_path / "pipe": "is no file",
        Path("/dev/zero"): "is no file",
        tmp_path / "circle": "cannot be read",
        tmp_path / ("n" * 300): "cannot be read",
        tmp_path / "none.yaml": "no such block file",
    }.items():
        with pytest.raises(BlockFileError, match=problem):
            read_block(path)


def test_a_wrong_value_at_any_key_is_one_line() -> None:
    """Every key with values of every kind: accepted, or one line with the key."""
    values = [
        10**400,
        -(10**30),
        2**64,
        1e300,
        float("nan"),
        float("inf"),
        True,
        None,
        "x" * 500,
        "",
        -1,
        0,
        1.5,
        [],
        {},
    ]
    values += [
        [None],
        [[1] * 4] * 4,
        [10**400] * 4,
        [float("nan")] * 4,
        {"a": 1},
        {7: 1},
        {"path": 5},
        {"path": []},
        "\n",
    ]
    for key in declared_keys(BlockFileSettings):
        for value in values:
            keys: dict[str, Any] = {"name": "a", "buildings": {"path": "b"}}
            *parents, leaf = key.split(".")
            inner = keys
            for parent in parents:
                inner = inner.setdefault(parent, {})
            inner[leaf] = value
            try:
                validate_block_settings(keys)
            except ValueError as error:
                message = str(error)
                assert message.isprintable(), key
                assert message.partition(":")[0].startswith(("7", "a", key, key.partition(".")[0])), message
                assert len(message) < 400, message


def test_changed_bytes_of_a_block_file_are_read_or_refused(tmp_path: Path) -> None:
    chance = random.Random(20)
    good, said = GOOD.encode(), []
    pieces = [
        b"&a ",
        b"*a",
        b"!!",
        b"[",
        b"{",
        b"? ",
        b"- ",
        b": ",
        b"\0",
        b"\xff",
        b"\xed\xa0\x80",
        b"|\n",
        b"'",
        b'"\\',
        b"#",
        b"%",
        b"\t",
    ]
    for _ in range(300):
        changed = bytearray(good)
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(changed))
            changed[at : at + chance.randint(0, 3)] = chance.choice([*pieces, bytes([chance.randrange(256)])])
        (tmp_path / "block.yaml").write_bytes(changed)
        try:
            validate_block_settings(read_yaml(tmp_path / "block.yaml"))
        except ValueError as error:
            said.append(str(error))
    assert len(said) > 100
    assert not [message for message in said if "\n" in message]


@pytest.mark.parametrize("case", ["yaml-deep-list", "key-bpath-tilde", "key-bpath-long-name", "key-offset-nan"])
def test_cases_of_before(case: str, data: Path) -> None:
    if not (data / "bad_inputs" / case).is_dir():
        pytest.skip("no bad inputs in the data folder")
    with pytest.raises(InputError, match=r"block\.yaml: (line \d+|buildings\.\w+)"):
        read_block(data / "bad_inputs" / case / "block.yaml")
