"""Taking back what people corrected, in an export or in the viewer: what differs from what was published goes beside the block
file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from catalogs.block.corrections import (
    OF_BUILDINGS,
    OF_FACADES,
    Correction,
    Corrections,
    add_corrections,
    checked,
    corrections_file,
    read_corrections,
)
from catalogs.block.yaml_files import read_yaml
from catalogs.frames import LONLAT, between
from catalogs.published.places import Folder
from catalogs.readers.annotations import Said, pictures_of, read_annotations, said_in
from facade_core.correction import unlike
from facade_core.errors import InputError
from facade_core.types import Element
from tasks.published.opened import Published, published
from tasks.store.standing import recorded_source

# Exports round boxes to a hundredth of a texel, the journal to a tenth: what differs by less was not moved. Heights likewise.
MOVED, METRES = 0.6, 0.006


@dataclass(frozen=True)
class Imported:
    """What an import came to: the file it went to, the block file, how many facades and buildings were corrected, and what to
    look at: corrections by somebody else that newer ones took the place of."""

    file: Path
    block: Path
    facades: int
    buildings: int
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        if not self.facades + self.buildings:
            return ["nothing differs from what was published; nothing was written"]
        return [
            f"{self.facades} facades and {self.buildings} buildings corrected in {self.file}",
            f"what depends on them is due: streetloom run {self.block}",
        ]


def import_corrections(out: Folder, path: Path, *, who: str, why: str = "", when: datetime | None = None) -> Imported:
    """Take back corrections of what the run in `out` published from a file. All are written, or none.

    Raises InputError for a file that is none, ids that the block has not, and values that cannot be.
    """
    with published(out) as found:
        said = read_annotations(path, pictures_of(list(found.plan.facades.id)))
        return _take(out, found, said, str(path), who=who, why=why, when=when)


def take_corrections(
    out: Folder, corrections: Sequence[Mapping[str, Any]], named: str, *, who: str, why: str = ""
) -> Imported:
    """The same of corrections as streetloom's own JSON lists them; `named`: what they are called where one cannot be."""
    with published(out) as found:
        return _take(out, found, said_in(corrections, named), named, who=who, why=why)


def block_of(out: Folder) -> Path:
    """The block file of the run in `out`, beside which its corrections are. Raises InputError where it is gone."""
    block = recorded_source(out)
    if block is None or not block.is_file():
        raise InputError(f"{out}: its block file {block or ''} is not there any more; corrections are kept beside it")
    return block


def _take(
    out: Folder,
    found: Published,
    said: Sequence[Said],
    named: str,
    *,
    who: str,
    why: str,
    when: datetime | None = None,
) -> Imported:
    block = block_of(out)
    stamp = (when or datetime.now(UTC)).strftime("%Y-%m-%dT%H:%M:%SZ")
    told = _Told(found, read_corrections(block), of_part="part" in read_yaml(block))
    new = [
        one
        for id, what, value in said
        if (one := told.correction(named, (id, what, value), who=who, why=why, when=stamp)) is not None
    ]
    if new:
        add_corrections(block, new)
    facades = {one.id for one in new if one.what in OF_FACADES}
    buildings = {one.id for one in new if one.what in OF_BUILDINGS}
    return Imported(corrections_file(block), block, len(facades), len(buildings), tuple(told.notes))


class _Told:
    """What stands of a block now: as published, or as somebody corrected it."""

    def __init__(self, found: Published, before: Corrections, *, of_part: bool) -> None:
        self.found, self.before, self.of_part = found, before, of_part
        self.facades = {id: index for index, id in enumerate(found.plan.facades.id)}
        self.buildings = {id: index for index, id in found.names.items()}
        self.exemplars = [record["unit"] for record in found.journals["exemplars"] if record]
        self.notes: list[str] = []

    def correction(self, named: str, said: Said, *, who: str, why: str, when: str) -> Correction | None:
        """What was said, as a correction; None where nothing is another than it stands."""
        id, what, value = said
        try:
            one = checked(Correction(id, what, value, who=who, when=when, why=why))
        except InputError as error:
            raise InputError(f"{named}: {error}") from error
        known = self.facades if what in OF_FACADES else self.buildings
        if id not in known:
            kind = "facade" if what in OF_FACADES else "building"
            near = get_close_matches(id, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known are e.g. {', '.join(list(known)[:3])}"
            raise InputError(f"{named}: the block {self.found.block} has no {kind} {id}; {hint}")
        if what == "exemplar" and one.value is not None and one.value not in self.exemplars:
            raise InputError(
                f"{named}: {id}: there is no exemplar {one.value}; there is {', '.join(self.exemplars[:5])}"
            )
        if self.of_part and what in ("height", "levels"):
            raise InputError(
                f"{named}: {id}: {what} of a city's buildings is corrected in the map that the city's file names"
            )
        if not self._differs(one):
            return None
        self._conflict(one)
        return self._placed(one) if what in OF_FACADES else one

    def _differs(self, one: Correction) -> bool:
        stands = self.before.value(one.id, one.what)
        if one.value is None or stands is not None:
            return not self._same(one, stands)
        if one.what == "elements":
            return not self._same(one, self._elements(one.id))
        table, building = self.found.buildings, self.buildings.get(one.id)
        if one.what == "height":
            return abs(one.value - float(table["height"][building])) > METRES
        if one.what == "levels":
            return one.value != (int(table["levels"][building]) or None)
        return True

    def _same(self, one: Correction, stands: Any) -> bool:
        if one.what != "elements" or one.value is None or stands is None:
            return one.value == stands
        said, there = (self._drawn(one.id, layout) for layout in (one.value, stands))
        return len(said) == len(there) and not (unlike(said, there, moved=MOVED) or unlike(there, said, moved=MOVED))

    def _drawn(self, facade: str, shares: Sequence[Sequence[Any]]) -> list[Element]:
        """Elements in shares of a wall, in its texels."""
        height, width = self._size(facade)
        return [Element(label, x0 * width, y0 * height, x1 * width, y1 * height) for label, x0, y0, x1, y1 in shares]

    def _elements(self, facade: str) -> list[Any]:
        height, width = self._size(facade)
        found = self.found.elements(self.facades[facade])
        shares = [(e.label, e.x0 / width, e.y0 / height, e.x1 / width, e.y1 / height) for e in found]
        return [(label, *(min(max(v, 0.0), 1.0) for v in box)) for label, *box in shares]

    def _size(self, facade: str) -> tuple[int, int]:
        placement, chart = self.found.plan.scene.placement, int(self.found.plan.facades.chart[self.facades[facade]])
        return int(placement.height[chart]), int(placement.width[chart])

    def _conflict(self, one: Correction) -> None:
        stands = self.before.of.get(one.id, {}).get(one.what)
        if stands is not None and stands.who != one.who:
            self.notes.append(
                f"{one.what} of {one.id}: {stands.who or 'somebody'} corrected it on {stands.when[:10]}, {one.who} does now, "
                "which counts; both are kept"
            )

    def _placed(self, one: Correction) -> Correction:
        plan, index = self.found.plan, self.facades[one.id]
        charts, chart = plan.scene.charts, int(plan.facades.chart[index])
        middle = charts.origin[chart, :2] + charts.axis_u[chart, :2] * charts.size[chart, 0] / 2
        longitude, latitude = between(self.found.crs, LONLAT)(middle[:1], middle[1:])
        return Correction(
            one.id,
            one.what,
            one.value,
            (round(float(longitude[0]), 7), round(float(latitude[0]), 7)),
            round(float(plan.facades.width[index]), 2),
            one.who,
            one.when,
            one.why,
        )
