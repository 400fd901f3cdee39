"""Fetching example blocks from a server on loopback: checked, kept, refused in one line."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import yaml

from catalogs.block.key_faults import validate_block_settings
from catalogs.block.yaml_files import read_yaml
from catalogs.examples.painted_pictures import PAINTED_FOLDERS
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER, EXAMPLE_SOURCES, ExampleDataFile, ExampleDataSource
from facade_core.core.errors import InputError
from tasks.examples.fetch import fetch_block

CONTENT = b'{"type": "CityJSON"}'
PATH = "city/delfshaven/3-20-DELFSHAVEN.city.json"


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """A server on loopback that publishes one file."""
    published = tmp_path / "published"
    published.mkdir()
    (published / "model.json").write_bytes(CONTENT)

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None: ...

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(published)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def fetch(address: str, tmp_path: Path) -> Callable[..., tuple[Path, ExampleDataSource]]:
    """Fetch the block delfshaven, whose one file is published at loopback, with a checksum."""

    def fetched(folder: Path, name: str, sha256: str) -> tuple[Path, ExampleDataSource]:
        source = ExampleDataSource("open data", (ExampleDataFile(PATH, address + name, sha256),))
        return fetch_block("delfshaven", folder, {"delfshaven": source})

    return fetched


def test_a_fetched_block_names_what_was_fetched(
    fetch: Callable[..., tuple[Path, ExampleDataSource]], tmp_path: Path
) -> None:
    block, source = fetch(tmp_path / "blocks", "model.json", hashlib.sha256(CONTENT).hexdigest())
    assert source.licence == "open data"
    keys = validate_block_settings(read_yaml(block))
    assert (block.parent / str(keys.buildings.path)).read_bytes() == CONTENT
    assert keys.imagery.exemplars is not None
    assert keys.imagery.exemplars.path == "exemplars"
    assert "$" not in block.read_text()
    assert len(list((block.parent / "exemplars").glob("*.webp"))) == len(list(PAINTED_FOLDERS[0].glob("*.webp")))


def test_what_is_there_is_not_fetched_again(
    fetch: Callable[..., tuple[Path, ExampleDataSource]], tmp_path: Path
) -> None:
    (tmp_path / PATH).parent.mkdir(parents=True)
    (tmp_path / PATH).write_bytes(CONTENT)
    fetch(tmp_path, "gone.json", hashlib.sha256(CONTENT).hexdigest())


@pytest.mark.parametrize(
    ("name", "sha256", "words"),
    [("model.json", "0" * 64, "checksum differs"), ("gone.json", "0" * 64, "cannot be fetched from http")],
)
def test_a_file_that_is_not_what_it_was_is_refused(
    fetch: Callable[..., tuple[Path, ExampleDataSource]], tmp_path: Path, name: str, sha256: str, words: str
) -> None:
    with pytest.raises(InputError, match=words) as error:
        fetch(tmp_path, name, sha256)
    assert "\n" not in str(error.value)
    assert not (tmp_path / PATH).exists()


def test_a_name_without_public_data_is_told_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is amsterdam-dam, amsterdam-ij, delfshaven, plateau"):
        fetch_block("atlantis", tmp_path)


@pytest.mark.parametrize("name", sorted(EXAMPLE_SOURCES))
def test_a_source_brings_every_file_that_its_block_names(name: str) -> None:
    named = yaml.safe_load((EXAMPLE_BLOCKS_FOLDER / f"{name}.yaml").read_text())
    text = str(named).replace("${STREETLOOM_DATA}/", "")
    brought = [file.path for file in EXAMPLE_SOURCES[name].files] + [
        path for path, _ in EXAMPLE_SOURCES[name].companion_files
    ]
    paths = named["buildings"]["path"]
    for path in [paths] if isinstance(paths, str) else paths:
        assert path.replace("${STREETLOOM_DATA}/", "") in brought
    assert "facades/ecp" in text, "replaced by painted exemplars when fetched"


@pytest.mark.parametrize("name", sorted(EXAMPLE_SOURCES))
def test_checksums_are_those_of_the_data_folder(name: str, data: Path) -> None:
    for file in EXAMPLE_SOURCES[name].files:
        assert hashlib.sha256((data / file.path).read_bytes()).hexdigest() == file.sha256
