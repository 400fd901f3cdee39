"""Photos taken at night, and which are refused: `python -m benchmarks.night_photos --data DIR`.

Street photos as taken, each marked by eye as of the day, the twilight or the night (night_photos.json; what it does not name
is of the day). Thresholds were set on the sets `tuned`; `held_out` was counted twice, after 0153 and 0161.
Printed for each: how many photos of each time are refused as taken at night.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from pathlib import Path

from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.photo_state import AT_NIGHT
from tasks.stages.facades.photos import crop_facade_photo

MARKS = Path(__file__).with_suffix(".json")
# Every so many photos of RueMonge, which are of one day.
RUEMONGE_STEP = 5


def is_refused_as_night(path: Path) -> bool:
    """Return whether a photo as taken is refused because it was taken at night."""
    try:
        crop_facade_photo(path, rectified=False)
    except ImageError as error:
        return AT_NIGHT in str(error)
    return False


def count_refused(data: Path, times_by_folder: dict[str, dict[str, list[str]]]) -> dict[str, dict[str, int]]:
    """Count the photos of each time, and of these the refused ones."""
    marked = []
    for folder, times in times_by_folder.items():
        time_by_name = {name: time for time, names in times.items() for name in names}
        paths = sorted((data / folder).glob("*.jpg"))[:: RUEMONGE_STEP if "ruemonge" in folder else 1]
        marked += [(time_by_name.get(path.name.split("_png")[0].removesuffix(".jpg"), "day"), path) for path in paths]
    every = Counter(time for time, _ in marked)
    refused = Counter(time for time, path in marked if is_refused_as_night(path))
    return {time: {"refused": refused[time], "photos": count} for time, count in sorted(every.items())}


def main(arguments: list[str] | None = None) -> None:
    """Print the counts of each set as JSON."""
    parser = argparse.ArgumentParser(description="Count the photos that are refused as taken at night.")
    default = Path(os.environ.get("STREETLOOM_DATA", "../shared/data"))
    parser.add_argument("--data", type=Path, default=default, help="folder with facades/ and streetphotos/")
    options = parser.parse_args(arguments)
    sets = json.loads(MARKS.read_text(encoding="utf-8"))
    counts = {half: count_refused(options.data, folders) for half, folders in sets.items()}
    print(json.dumps({"benchmark": "night_photos"} | counts))


if __name__ == "__main__":
    main()
