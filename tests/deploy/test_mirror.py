"""A file of the network is fetched when it is another, and the city made of it does what that changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest
from click.testing import CliRunner

from deploy.mirror import main, mirror
from tasks.city.city_log import load_or_partition_city
from tests.tasks.city.test_account import HOUSES, town


@dataclass
class Upstream:
    """What a server has, how it says which version that is, and with what it answered."""

    data: bytes = b""
    tags: bool = True
    cut: int = 0
    answers: list[int] = field(default_factory=list)


@contextmanager
def serving(upstream: Upstream) -> Iterator[str]:
    class Answers(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            tag = f'"{hashlib.sha256(upstream.data).hexdigest()[:16]}"'
            same = upstream.tags and self.headers["If-None-Match"] == tag
            upstream.answers.append(304 if same else 200)
            self.send_response(upstream.answers[-1])
            if upstream.tags:
                self.send_header("ETag", tag)
            if not same:
                self.send_header("Content-Length", str(len(upstream.data)))
            self.end_headers()
            if not same:
                self.wfile.write(upstream.data[: len(upstream.data) - upstream.cut])

        def log_message(self, *said: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Answers) as server:
        thread = Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/buildings.geojson"
        finally:
            server.shutdown()
            thread.join()


def test_only_what_changed_upstream_is_fetched_and_due(tmp_path: Path) -> None:
    """Nights of a city of somebody else's buildings: of the second nothing is due, of the third the block of one house."""
    elsewhere, here = tmp_path / "elsewhere", tmp_path / "here"
    town(elsewhere)
    upstream, city = Upstream((elsewhere / "buildings.geojson").read_bytes()), town(here)
    buildings = here / "buildings.geojson"
    buildings.unlink()
    with serving(upstream) as url:
        assert mirror(url, buildings)
        first, _ = load_or_partition_city(city, here / "out")
        assert len(first.blocks) == len(HOUSES)
        kept = buildings.stat().st_ino

        assert not mirror(url, buildings)
        assert buildings.stat().st_ino == kept
        second, _ = load_or_partition_city(city, here / "out")
        assert (second.source, second.digests) == (first.source, first.digests)

        town(elsewhere, HOUSES | {"h1": (340, 5, 12, 6, 9.0)})
        upstream.data = (elsewhere / "buildings.geojson").read_bytes()
        assert mirror(url, buildings)
        third, _ = load_or_partition_city(city, here / "out")
        assert sum(third.digests[name] != digest for name, digest in first.digests.items()) == 1
    assert upstream.answers == [200, 304, 200]


def test_what_does_not_come_whole_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    file, upstream = tmp_path / "a.json", Upstream(json.dumps(["old"]).encode())
    with serving(upstream) as url:
        mirror(url, file)
        upstream.data, upstream.cut = json.dumps(["new", "and longer"]).encode(), 5
        broken = CliRunner().invoke(main, [url, str(file)])
        assert broken.exit_code == 1
        assert broken.output == f"{url}: 5 bytes did not come; {file} is as it was\n"
        assert json.loads(file.read_text()) == ["old"]
        upstream.cut = 0
        assert CliRunner().invoke(main, [url, str(file)]).output == f"{file}: fetched\n"
        assert json.loads(file.read_text()) == ["new", "and longer"]
    away = CliRunner().invoke(main, [url, str(file)])
    assert away.exit_code == 1
    assert "Connection refused" in away.output
    assert {path.name for path in tmp_path.iterdir()} == {"a.json", ".a.json.json"}, "nothing half is left"


def test_a_server_that_tells_no_versions_is_asked_for_all_of_it(tmp_path: Path) -> None:
    upstream = Upstream(b"[]", tags=False)
    with serving(upstream) as url:
        assert mirror(url, tmp_path / "a.json")
        assert mirror(url, tmp_path / "a.json")


def test_the_tag_of_another_address_is_not_asked_for(tmp_path: Path) -> None:
    upstream = Upstream(b"[]")
    with serving(upstream) as url:
        mirror(url, tmp_path / "a.json")
        assert mirror(f"{url}?other", tmp_path / "a.json")
    with pytest.raises(ValueError, match="no address"):
        mirror("file:///a.json", tmp_path / "a.json")
