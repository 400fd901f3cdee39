"""Exports in viewers of a browser: CesiumJS, and three.js with 3d-tiles-renderer."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.programs import package, served

PAGES = Path(__file__).parent / "pages"
# A viewer that has nothing to show by then never will: where much else runs, everything takes many times as long.
PATIENCE_S = 1200


@dataclass(frozen=True)
class Opened:
    """An export in a viewer's page; said: what the page complained of, and what it asked other machines for."""

    page: Any
    said: list[str]
    seconds: float

    def __call__(self, expression: str) -> Any:
        return self.page.evaluate(expression)


@contextmanager
def in_cesium(browser: Any, tiles: Path, *, error: float = 1.0, side: int = 256) -> Iterator[Opened]:
    """A tileset in CesiumJS, from above, every tile of it that is in view down to an error of so many pixels."""
    places = {"tiles": tiles, "cesium": package("cesium") / "Build" / "Cesium"}
    with _opened(browser, "cesium", places, f"start({error})", side) as opened:
        yield opened


@contextmanager
def in_three(browser: Any, shown: Path, *, error: float = 1.0, side: int = 256) -> Iterator[Opened]:
    """A tileset (its folder), or a GLB, in three.js."""
    folder = shown if shown.is_dir() else shown.parent
    places = {"tiles": folder, "three": package("three"), "renderer": package("3d-tiles-renderer")}
    call = f"tiles({error})" if shown.is_dir() else f"model('/tiles/{shown.name}')"
    with _opened(browser, "three", places, call, side) as opened:
        yield opened


@contextmanager
def _opened(browser: Any, name: str, places: dict[str, Path], call: str, side: int) -> Iterator[Opened]:
    with served(pages=PAGES, **places) as address:
        page = browser.new_page(viewport={"width": side, "height": side})
        page.set_default_timeout(1000 * PATIENCE_S)
        said: list[str] = []
        own = (address, "data:", "blob:")
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
        page.on("request", lambda one: said.append(one.url) if not one.url.startswith(own) else None)
        try:
            page.goto(f"{address}/pages/{name}.html")
            start = time.monotonic()
            page.evaluate(call)
            while not page.evaluate("shown.ready"):
                if time.monotonic() > start + PATIENCE_S or said:
                    raise TimeoutError(f"{name} has not shown {places['tiles']}: {said} {page.evaluate('figures()')}")
                page.wait_for_timeout(50)
            yield Opened(page, said, time.monotonic() - start)
        finally:
            page.close()
