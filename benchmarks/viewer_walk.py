"""A walk in the 3D page of `streetloom view`: seconds until the model is there, frames a second, memory, and a film.

    streetloom view out/demo --no-open &
    python -m benchmarks.viewer_walk http://127.0.0.1:8710 --film docs/walk.webp

Chromium draws in software, as without a graphics card.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import time
from pathlib import Path
from typing import Any

import psutil
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from benchmarks.programs import chromium

STATE = "({...document.getElementById('model').dataset})"
# Frames of the film, metres of the walk between two, and milliseconds that one is shown.
FRAMES, STEP_MS, SHOWN_MS = 48, 350, 120
FILM_SIZE = (800, 410)


def open_model(page: Page, address: str) -> tuple[float, float]:
    """Open the 3D page; returns the seconds until its first model is shown, and all."""
    begun, first = time.time(), 0.0
    page.goto(f"{address}/#/model")
    page.wait_for_selector("#model")
    while True:
        state = page.evaluate(STATE)
        first = first or (time.time() - begun if int(state.get("models") or 0) else 0.0)
        if state.get("stands") == "true" and state.get("missing") == "0" and state.get("coming") == "0":
            return round(first, 1), round(time.time() - begun, 1)
        page.wait_for_timeout(100)


def measure(page: Page, address: str) -> dict[str, Any]:
    """Open the page, and turn, walk and look from above for six seconds each."""
    found: dict[str, Any] = dict(zip(("first_model", "all_models"), open_model(page, address), strict=True))
    page.wait_for_timeout(1500)
    for what, key in (("turn", "e"), ("walk", "w"), ("bird", "e")):
        if what == "bird":
            page.keyboard.press("b")
            page.wait_for_timeout(4000)
        drawn, start = int(page.evaluate(STATE)["drawn"]), time.time()
        page.keyboard.down(key)
        page.wait_for_timeout(6000)
        found[what] = round((int(page.evaluate(STATE)["drawn"]) - drawn) / (time.time() - start), 1)
        page.keyboard.up(key)
    family = [one for one in psutil.process_iter(["name", "cmdline"]) if "chrom" in (one.info["name"] or "")]
    drawers = [one for one in family if "--type=" in " ".join(one.info["cmdline"] or [])]
    return found | {
        "card_mb": round(int(page.evaluate(STATE)["bytes"]) / 1e6),
        "memory_mb": round(sum(one.memory_info().rss for one in drawers) / 1e6),
        "load": round(os.getloadavg()[0], 1),
    }


def film(page: Page, address: str, to: Path) -> None:
    """Write a walk along the street where the page opens, and a look around, as an animated picture."""
    open_model(page, address)
    page.locator("#model").focus()
    page.wait_for_timeout(2000)
    frames = []
    for number in range(FRAMES):
        key = "w" if number < 3 * FRAMES // 4 else "e"
        page.keyboard.down(key)
        page.wait_for_timeout(STEP_MS)
        page.keyboard.up(key)
        page.wait_for_timeout(600)
        shot = Image.open(io.BytesIO(page.locator("#model").screenshot(type="png"))).convert("RGB")
        frames.append(shot.resize(FILM_SIZE, Image.Resampling.LANCZOS))
    frames[0].save(to, save_all=True, append_images=frames[1:], duration=SHOWN_MS, loop=0, quality=60, method=4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", help="address of `streetloom view`")
    parser.add_argument("--film", type=Path, help="write an animated picture of a walk")
    arguments = parser.parse_args()
    with sync_playwright() as playwright, chromium(playwright) as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(240_000)
        if arguments.film:
            film(page, arguments.address, arguments.film)
        else:
            print(json.dumps(measure(page, arguments.address), indent=2))


if __name__ == "__main__":
    main()
