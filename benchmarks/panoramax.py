"""A real Panoramax server, filled and fetched from: `python -m benchmarks.panoramax --fill --data DIR --api URL`.

GeoVisio, the server, keeps its places in PostGIS, which no package of Python's brings: Debian's postgresql-15-postgis-3 does.

    createdb -h 127.0.0.1 geovisio && psql -h 127.0.0.1 geovisio -c "CREATE EXTENSION postgis"
    python -m venv geovisio && geovisio/bin/pip install geovisio==2.15.1
    export FLASK_APP=geovisio DB_URL=postgresql://127.0.0.1/geovisio FS_URL=$PWD/files FLASK_SECRET_KEY=any
    export API_PICTURES_LICENSE_SPDX_ID=etalab-2.0 API_PICTURES_LICENSE_URL=https://spdx.org/licenses/etalab-2.0.html
    geovisio/bin/flask db upgrade && geovisio/bin/flask run --port 5000

Prints one JSON object: what was offered and fetched, whether it is what was uploaded, what a second run asked for,
"""

from __future__ import annotations

import argparse
import json
import math
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from catalogs.block.reader import read_block
from catalogs.imagery.services import stac_service
from catalogs.readers.pictures.source_poses import degrees_from_dms
from tasks.fetching import fetch_block_panoramas, fetch_box_panoramas

STRASBOURG = (7.0, 48.0, 8.0, 49.0)
# Pictures of a server that is being filled are ready after some seconds each.
PATIENCE_S = 300.0
Placed = tuple[Path, float, float, float | None, str]


def of_panoramas(data: Path) -> Iterator[Placed]:
    """The street panoramas: file, longitude, latitude, heading, time."""
    for one in json.loads((data / "panoramas" / "index.json").read_text(encoding="utf-8")):
        gps = one.get("exif_gps") or {}
        if "GPSLongitude" not in gps:
            continue
        lon, lat = (degrees_from_dms(gps[f"GPS{axis}"], gps.get(f"GPS{axis}Ref")) for axis in ("Longitude", "Latitude"))
        day = str(gps.get("GPSDateStamp", "2022:01:01")).replace(":", "-")
        hour, minute, second = (int(float(part)) for part in gps.get("GPSTimeStamp", (12, 0, 0)))
        heading = gps.get("GPSImgDirection", one.get("heading_deg"))
        yield (
            data / "panoramas" / one["file"],
            lon,
            lat,
            None if heading is None else float(heading),
            f"{day}T{hour:02}:{minute:02}:{second:02}Z",
        )


def of_amsterdam(data: Path) -> Iterator[Placed]:
    """Those of the block amsterdam-dam, which look to grid north."""
    from pyproj import Transformer

    folder = data / "city" / "amsterdam"
    stated = json.loads((folder / "poses_and_walls.json").read_text(encoding="utf-8"))
    to_lonlat = Transformer.from_crs(stated["crs"], "EPSG:4326", always_xy=True)
    for name, (x, y, _) in stated["camera_positions"].items():
        (lon, ahead), (lat, up) = to_lonlat.transform([x, x], [y, y + 100.0])
        heading = math.degrees(math.atan2((ahead - lon) * math.cos(math.radians(lat)), up - lat)) % 360
        yield folder / "panoramas" / f"{name}.jpg", lon, lat, heading, "2021-03-01T10:00:00Z"


def fill(api: str, title: str, pictures: list[Placed]) -> int:
    """Upload pictures as one sequence; how many the server took."""
    import requests

    collection = requests.post(f"{api}/collections", json={"title": title}, timeout=60).json()["id"]
    taken = 0
    for place, (path, lon, lat, heading, when) in enumerate(pictures, 1):
        told = {"position": place, "override_longitude": lon, "override_latitude": lat, "override_capture_time": when}
        told["override_Xmp.GPano.ProjectionType"] = "equirectangular"
        if heading is not None:  # as EXIF has it, a fraction
            told |= {"override_Exif.GPSInfo.GPSImgDirection": f"{round(heading * 100)}/100"}
            told |= {"override_Exif.GPSInfo.GPSImgDirectionRef": "T"}
        with path.open("rb") as file:
            asked = requests.post(
                f"{api}/collections/{collection}/items",
                data=told,
                files={"picture": (path.name, file, "image/jpeg")},
                timeout=60,
            )
        taken += asked.ok
    return taken


def wait_until_ready(api: str, count: int) -> None:
    """Until a search finds so many pictures; raises TimeoutError."""
    import requests

    ends = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends:
        found = requests.get(f"{api}/search", params={"limit": "1000", "bbox": "-180,-90,180,90"}, timeout=60).json()
        if len(found["features"]) >= count:
            return
        time.sleep(1.0)
    raise TimeoutError(f"{api}: of {count} pictures not all were ready after {PATIENCE_S:.0f} s")


def fetched(api: str, data: Path, folder: Path) -> dict[str, Any]:
    """Fetch the panoramas around Strasbourg, twice, and those of the block amsterdam-dam."""
    first = fetch_box_panoramas(STRASBOURG, folder / "strasbourg", stac_service(api))
    second = fetch_box_panoramas(STRASBOURG, folder / "strasbourg", stac_service(api))
    blocks = Path(__file__).resolve().parent.parent / "catalogs" / "examples" / "blocks"
    text = (
        (blocks / "amsterdam-dam.yaml").read_text(encoding="utf-8").replace("${STREETLOOM_DATA}", str(data.resolve()))
    )
    block = folder / "amsterdam" / "block.yaml"
    block.parent.mkdir()
    block.write_text("".join(line for line in text.splitlines(True) if "panoramas:" not in line), encoding="utf-8")
    of_block = fetch_block_panoramas(block, stac_service(api))
    assert of_block.choice is not None
    same = [_likeness(folder / "strasbourg" / one.file, data) for one in first.log.pictures.values()]
    stated = json.loads((data / "city" / "amsterdam" / "poses_and_walls.json").read_text(encoding="utf-8"))
    places = np.array(list(stated["camera_positions"].values()))[:, :2]
    poses = [panorama.pose for panorama in read_block(block).panoramas]
    off = [float(np.hypot(*(places - (pose.x, pose.y)).T).min()) for pose in poses]
    return {
        "offered": first.offered,
        "fetched": len(first.log.pictures),
        "faults": [f"{fault.id}: {fault.reason}" for fault in first.faults],
        "licences": sorted({str(one.licence) for one in first.log.pictures.values()}),
        "days": sorted({str(one.captured) for one in first.log.pictures.values()}),
        "pictures_that_are_those_uploaded": sum(same),
        "asked_for_by_a_second_run": second.chosen - second.earlier,
        "block": {
            "offered": of_block.offered,
            "chosen": of_block.chosen,
            "facades_shown": of_block.choice.facades_shown,
            "square_metres_shown": round(of_block.choice.reached),
            "metres_off_what_was_uploaded": round(max(off), 3),
            "degrees_off": round(max(abs((pose.heading + 180.0) % 360.0 - 180.0) for pose in poses), 3),
        },
    }


def _likeness(path: Path, data: Path) -> bool:
    """Whether the pixels of a fetched picture are those of one of the data folder: the server writes its metadata anew."""
    from PIL import Image

    got = np.asarray(Image.open(path))
    return any(
        np.array_equal(got, np.asarray(Image.open(other)))
        for other in (data / "panoramas").glob("*.jpg")
        if Image.open(other).size == got.shape[1::-1]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")))
    parser.add_argument("--api", default="http://127.0.0.1:5000/api", help="of the server")
    parser.add_argument("--fill", action="store_true", help="upload the panoramas first")
    asked = parser.parse_args()
    if asked.fill:
        taken = fill(asked.api, "streets", list(of_panoramas(asked.data)))
        taken += fill(asked.api, "Amsterdam", list(of_amsterdam(asked.data)))
        wait_until_ready(asked.api, taken)
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(fetched(asked.api, asked.data, Path(folder)), indent=1))


if __name__ == "__main__":
    main()
