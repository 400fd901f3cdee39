"""Files of geometry that a block file names, read in the frames that it states."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from catalogs.block.block_file import BlockFileErrorContext
from catalogs.block.keys import BlockFileSettings, BuildingsSection, GroundSection, StreetsSection
from catalogs.buildings.axis_mistakes import looks_like_degrees
from catalogs.buildings.extents import BuildingSource
from catalogs.crs import is_same_frame, parse_crs
from catalogs.features import CentrelinesAndGround, Fault, Remark, feature_ids_by_reason, format_reason_notes
from catalogs.readers.formats import read_buildings, read_centrelines, read_ground_features
from catalogs.readers.source_keys import SUFFIXES_OF_KEYS, SourceKeys
from facade_core.core.errors import BlockFileError, InputError

NamedFiles = Mapping[str, tuple[Path, ...]]
_UNSTATED_FRAME_REASON = (
    "files of buildings that state no frame taken in the block's crs; give buildings.crs where it is another"
)


def read_building_sources(
    keys: BlockFileSettings, files: NamedFiles, file: BlockFileErrorContext
) -> list[BuildingSource]:
    """Read each building file, with the frame and offset that the block file states."""
    sources: list[BuildingSource] = []
    given = _source_keys("buildings", keys.buildings, files, file)
    for path in files["buildings.path"]:
        source = file.call_reader("buildings.path", read_buildings, path, keys.buildings.lod, given)
        crs = keys.buildings.crs or source.crs or keys.crs
        if crs is None:
            remedy = "write crs: EPSG:..."
            if looks_like_degrees(source.bounding_boxes()):
                remedy = "its coordinates look like degrees: write buildings: {path: ..., crs: EPSG:4326}"
            raise file.make_error("buildings.crs", f"missing, and {path} states no frame; {remedy}")
        file.call_reader("buildings.crs", parse_crs, crs)
        remarks = (*source.remarks, *_overruled_frame(path, source.crs, "buildings", keys.buildings.crs))
        if source.crs is None and keys.buildings.crs is None:
            remarks = (*remarks, Remark(path.name, _UNSTATED_FRAME_REASON, None))
        faults = tuple(_name_file_in_fault(fault, path) for fault in source.faults)
        source = replace(source, crs=crs, faults=faults, remarks=remarks)
        sources.append(source.translate(keys.buildings.offset) if keys.buildings.offset else source)
    if not any(source.items or source.faults for source in sources):
        names = ", ".join(map(str, files["buildings.path"]))
        raise _nothing_held_error("buildings", names, [remark for source in sources for remark in source.remarks], file)
    return sources


def read_named_centrelines(
    keys: BlockFileSettings, files: NamedFiles, sources: Sequence[BuildingSource], file: BlockFileErrorContext
) -> CentrelinesAndGround:
    assert keys.streets is not None
    given = _source_keys("streets", keys.streets, files, file)
    source = file.call_reader("streets.path", read_centrelines, files["streets.path"][0], given)
    path, crs = files["streets.path"][0], keys.streets.crs or source.crs or keys.crs or sources[0].crs
    faults = tuple(_name_file_in_fault(fault, path) for fault in source.faults)
    remarks = (*source.remarks, *_overruled_frame(path, source.crs, "streets", keys.streets.crs))
    source = replace(source, crs=crs, faults=faults, remarks=remarks)
    file.call_reader("streets.crs", parse_crs, source.crs)
    if not source.items and not source.faults:
        raise _nothing_held_error("streets", str(path), source.remarks, file)
    return _select_named_streets(source, keys.streets.names, file) if keys.streets.names else source


def read_ground_sources(
    keys: BlockFileSettings, files: NamedFiles, sources: Sequence[BuildingSource], file: BlockFileErrorContext
) -> list[CentrelinesAndGround]:
    """Read each ground file, with the frame that the block file states."""
    if keys.ground is None:
        return []
    given = _source_keys("ground", keys.ground, files, file)
    found = [file.call_reader("ground.path", read_ground_features, path, given) for path in files["ground.path"]]
    placed = [
        replace(
            one,
            crs=keys.ground.crs or one.crs or keys.crs or sources[0].crs,
            remarks=(*one.remarks, *_overruled_frame(path, one.crs, "ground", keys.ground.crs)),
        )
        for path, one in zip(files["ground.path"], found, strict=True)
    ]
    for one in placed:
        file.call_reader("ground.crs", parse_crs, one.crs)
    return placed


def _nothing_held_error(key: str, names: str, remarks: Sequence[Remark], file: BlockFileErrorContext) -> BlockFileError:
    """Return the error for files that hold no building or street; it names what was left out."""
    notes = format_reason_notes(feature_ids_by_reason(remarks))
    reason = f" ({notes[0]})" if notes else ""
    return file.make_error(f"{key}.path", f"{names} holds no {key}{reason}; give a file that does")


def _source_keys(
    key: str, section: BuildingsSection | StreetsSection | GroundSection, files: NamedFiles, file: BlockFileErrorContext
) -> SourceKeys:
    """Return what a section of the block file states of its files."""
    if section.crs is not None:
        file.call_reader(f"{key}.crs", parse_crs, section.crs)
    paths = files[f"{key}.path"]
    for name, (suffixes, what) in SUFFIXES_OF_KEYS.items():
        is_stated = getattr(section, name, None) is not None
        if is_stated and not any(path.suffix.lower() in suffixes for path in paths):
            raise file.make_error(f"{key}.{name}", f"{what}, which {paths[0].name} is not; remove it")
    return SourceKeys(**{one.name: getattr(section, one.name, None) for one in fields(SourceKeys)})


def _overruled_frame(path: Path, stated: str | None, section: str, given: str | None) -> tuple[Remark, ...]:
    """Return a remark if the block file gives another frame than a file states; none if the stated one is unknown."""
    try:
        if stated is None or given is None or is_same_frame(stated, given):
            return ()
    except InputError:  # the reason to give another
        return ()
    reason = (
        f"files that state {stated} taken in {given}, as {section}.crs says; remove that unless the files are wrong"
    )
    return (Remark(path.name, reason, None),)


def _name_file_in_fault(fault: Fault, path: Path) -> Fault:
    """Add the file's name to the reason of a fault."""
    return fault if path.name in fault.reason else replace(fault, reason=f"{path.name}: {fault.reason}")


def _select_named_streets(
    source: CentrelinesAndGround, names: list[str], file: BlockFileErrorContext
) -> CentrelinesAndGround:
    known = sorted({piece.name for piece in source.items if piece.name})
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            remedy = f"did you mean {close[0]}?" if close else f"known are e.g. {', '.join(known[:5])}"
            raise file.make_error("streets.names", f"no street is named {name!r}; {remedy}")
    return replace(source, items=tuple(piece for piece in source.items if piece.name in names))
