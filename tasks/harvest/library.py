"""Style library from street pictures: every picture is harvested once, and the best facades become exemplars."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catalogs.features import Fault
from catalogs.published.folders import write_atomically
from catalogs.readers.pictures.picture_kinds import LABEL_MAP_SUFFIX, is_picture_name
from facade_core.core.errors import InputError
from facade_core.core.regular_files import read_regular
from facade_core.imagery.rectify.same_facade import FacadeFeatures, detect_facade_features, show_same_facade
from facade_core.plan.exemplar_style import ExemplarLibrary
from tasks.engine.compute.connect import connect
from tasks.engine.inputs import CODE, digest_values, join_key
from tasks.engine.progress import begin_stage, report_progress
from tasks.engine.stage_code import stage_code_digest
from tasks.harvest import MIN_EXEMPLARS, MIN_SCORE
from tasks.harvest.record import (
    CANDIDATES_FOLDER,
    RECORDS_FOLDER,
    SHEETS_FOLDER,
    CandidateRecord,
    PictureRecord,
    read_picture_record,
)
from tasks.harvest.sheets import write_contact_sheets
from tasks.harvest.sources import SourcePicture, list_source_pictures
from tasks.harvest.statistics import summarise_style
from tasks.harvest.task import harvest_picture
from tasks.stages.shared.images import read_exemplar_picture

# List of the exemplars and of the rejected facades, in the folder of the library.
LIST_NAME = "exemplars.json"
# Statistics of the style, beside it.
STATISTICS_NAME = "statistics.json"
STAGE = "harvest"


class Candidate(NamedTuple):
    """Facade of a picture."""

    picture: SourcePicture
    record: CandidateRecord


@dataclass(frozen=True)
class HarvestResult:
    """Result of a harvest.

    Attributes
    ----------
    exemplars : accepted facades, best first.
    rejected : rejected facades with their reasons, by name.
    faults : files that are not read.
    sheets : contact sheets.
    weak : number of the exemplars that are below MIN_SCORE.
    pictures : number of pictures, and of those that an earlier harvest had done.
    seconds : seconds per picture, mean over all pictures.
    looked : whether faces and plates were looked for in all pictures.
    """

    exemplars: list[Candidate]
    rejected: list[tuple[Candidate, str]]
    faults: list[Fault]
    sheets: list[Path]
    weak: int
    pictures: int
    earlier: int
    seconds: float
    looked: bool


def harvest_style_library(
    places: Sequence[Path], out: Path, *, most: int, workers: int, licence: str | None = None
) -> HarvestResult:
    """Harvest a style library from street pictures. Resumable: a picture is harvested once.

    Parameters
    ----------
    places : files and folders of unposed photos and panoramas.
    out : folder of the library.
    most : number of exemplars at most.
    workers : local processes; the result is the same for any number.
    licence : licence of pictures that state none.

    Raises
    ------
    InputError : the pictures cannot be read, the folder holds other pictures, or no facade can be used.
    """
    pictures, faults = list_source_pictures(places, licence)
    earlier_files = _read_earlier_files(out)
    for folder in (RECORDS_FOLDER, CANDIDATES_FOLDER, SHEETS_FOLDER):
        (out / folder).mkdir(parents=True, exist_ok=True)
    records, earlier = _harvest_pictures(pictures, out, workers)
    candidates = [
        Candidate(picture, each)
        for picture, record in zip(pictures, records, strict=True)
        for each in record["candidates"]
    ]
    exemplars, rejected, surplus = choose_candidates(candidates, out, most)
    _write_library(exemplars, rejected, out, earlier_files)
    statistics = summarise_style([one.record for one in (*exemplars, *surplus)])
    write_atomically(out / STATISTICS_NAME, f"{json.dumps(statistics, indent=1)}\n".encode())
    sheets = write_contact_sheets(
        out, [one.record for one in exemplars], [(one.record, reason) for one, reason in rejected]
    )
    return HarvestResult(
        exemplars,
        rejected,
        faults,
        sheets,
        sum(one.record["score"] < MIN_SCORE for one in exemplars),
        len(pictures),
        earlier,
        sum(record["seconds"] for record in records) / max(1, len(records)),
        all(record["looked"] for record in records),
    )


def _read_earlier_files(out: Path) -> list[str]:
    """Names of the exemplars of an earlier harvest to this folder; InputError if it holds other pictures."""
    if not out.is_dir():
        return []
    try:
        listed = json.loads(read_regular(out / LIST_NAME))
        files = [str(each["file"]) for each in listed["exemplars"]]
    except FileNotFoundError:
        files = []
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{out / LIST_NAME} is no list of exemplars; remove it, or name a new folder with --out"
        ) from error
    others = sorted({path.name for path in out.iterdir() if is_picture_name(path.name)} - set(files))
    if others:
        raise InputError(
            f"{out} holds pictures that were not harvested, such as {others[0]}; name a new folder with --out"
        )
    return [file for file in files if Path(file).name == file]


def _harvest_pictures(pictures: Sequence[SourcePicture], out: Path, workers: int) -> tuple[list[PictureRecord], int]:
    """Harvest the pictures without a record; returns the records of all, and how many there were before."""
    code = stage_code_digest(STAGE)
    keys = [join_key({CODE: code} | digest_values(picture=[one.name, one.digest])) for one in pictures]
    known = [read_picture_record(out, one.digest, key) for one, key in zip(pictures, keys, strict=True)]
    earlier = sum(record is not None for record in known)
    begin_stage(STAGE, len(pictures), earlier)
    if earlier < len(pictures):
        with connect(workers, None, str(out)) as compute:
            submitted = [
                compute.submit(harvest_picture, one.path.absolute(), one.name, one.digest, key, out.absolute())
                for one, key, record in zip(pictures, keys, known, strict=True)
                if record is None
            ]
            for unit in compute.iterate_completed(submitted):
                unit.result()
                report_progress(STAGE, 1)
    records = []
    for one, key in zip(pictures, keys, strict=True):
        record = read_picture_record(out, one.digest, key)
        if record is None:
            raise InputError(f"{out}: the record of {one.path.name} is gone; run the same command again")
        records.append(record)
    return records, earlier


def choose_candidates(
    candidates: Sequence[Candidate], out: Path, most: int
) -> tuple[list[Candidate], list[tuple[Candidate, str]], list[Candidate]]:
    """Choose the best facades of each style family, each building once; the families keep their shares.

    Facades below MIN_SCORE are chosen only as far as there are not MIN_EXEMPLARS others.

    Returns
    -------
    The exemplars, the rejected ones with their reasons, and those of them that are rejected only for their number.
    """
    usable = [one for one in candidates if "reason" not in one.record]
    rejected = [(one, one.record["reason"]) for one in candidates if "reason" in one.record]
    distinct: list[Candidate] = []
    seen: list[tuple[FacadeFeatures, str]] = []
    for one in sorted(usable, key=lambda each: (-each.record["score"], each.record["name"])):
        picture = read_exemplar_picture(out / CANDIDATES_FOLDER / f"{one.record['file']}.png")
        features = detect_facade_features(picture.rgb, one.record["metres_per_pixel"])
        twin = next((name for other, name in seen if show_same_facade(features, other)), None)
        if twin is not None:
            rejected.append((one, f"the facade of {twin}, which is the better picture of it"))
            continue
        seen.append((features, one.record["name"]))
        distinct.append(one)
    enough = max(MIN_EXEMPLARS, sum(one.record["score"] >= MIN_SCORE for one in distinct))
    rejected += [(one, _explain_score(one.record)) for one in distinct[enough:]]
    distinct = distinct[:enough]
    kept = _keep_family_shares(_families(distinct), most)
    chosen = [one for one, is_kept in zip(distinct, kept, strict=True) if is_kept]
    surplus = [one for one, is_kept in zip(distinct, kept, strict=True) if not is_kept]
    reason = f"usable, but the {most} that are kept show its style better; raise --most to have it"
    rejected += [(one, reason) for one in surplus]
    return chosen, sorted(rejected, key=lambda pair: pair[0].record["name"]), surplus


def _explain_score(record: CandidateRecord) -> str:
    """Reason against a facade by its score, with the worst parts of it."""
    worst = sorted(record["parts"].items(), key=lambda part: part[1])[:2]
    parts = " and ".join(f"{name} {value:.2f}" for name, value in worst)
    return f"its score is {record['score']:.2f}, and {MIN_SCORE:.2f} is the least ({parts})"


def _keep_family_shares(families: Sequence[int], most: int) -> list[bool]:
    """Return which facades to keep, at most `most`: the first of each family, in proportion to its size."""
    family = np.asarray(families, np.int64)
    size = np.bincount(family)
    exact = size * min(1.0, most / max(1, len(family)))
    quota = np.floor(exact).astype(np.int64)
    missing = min(most, len(family)) - int(quota.sum())
    quota[np.argsort(quota - exact, kind="stable")[:missing]] += 1
    order = np.argsort(family, kind="stable")
    place = np.empty_like(family)  # within its family
    place[order] = np.arange(len(family)) - np.searchsorted(family[order], family[order])
    kept: list[bool] = (place < quota[family]).tolist()
    return kept


def _write_library(
    exemplars: Sequence[Candidate],
    rejected: Sequence[tuple[Candidate, str]],
    out: Path,
    earlier_files: Sequence[str],
) -> None:
    """Write the exemplars with their label maps and the list, and remove those of an earlier harvest that are none now."""
    files = {f"{one.record['name']}.png" for one in exemplars}
    for file in set(earlier_files) - files:
        (out / file).unlink(missing_ok=True)
        (out / f"{Path(file).stem}{LABEL_MAP_SUFFIX}").unlink(missing_ok=True)
    for one in exemplars:
        for suffix in (".png", LABEL_MAP_SUFFIX):
            content = (out / CANDIDATES_FOLDER / f"{one.record['file']}{suffix}").read_bytes()
            write_atomically(out / f"{one.record['name']}{suffix}", content)
    families = _families(exemplars)
    listing = {
        "exemplars": [
            {
                "file": f"{one.record['name']}.png",
                "picture": one.picture.path.name,
                **{
                    key: value
                    for key in ("source", "author", "licence", "licence_url")
                    if (value := getattr(one.picture, key)) is not None
                },
                "family": family,
                **{key: value for key, value in one.record.items() if key not in ("name", "file", "look")},
            }
            for one, family in zip(exemplars, families, strict=True)
        ],
        "rejected": [
            {"name": one.record["name"], "picture": one.picture.path.name, "reason": reason} for one, reason in rejected
        ],
    }
    write_atomically(out / LIST_NAME, f"{json.dumps(listing, ensure_ascii=False, indent=1)}\n".encode())


def _families(exemplars: Sequence[Candidate]) -> list[int]:
    """Family of each exemplar, as a run groups them by style."""
    records = [one.record for one in exemplars]
    zeros = np.zeros(len(records)).tolist()
    library = ExemplarLibrary(
        height=[one["height_m"] for one in records],
        floors=[one["floors"] for one in records],
        shops=zeros,
        fronts=zeros,
        body=zeros,
        foot=zeros,
        descriptors=[one["look"] for one in records],
    )
    families: list[int] = library.family.tolist()
    return families
