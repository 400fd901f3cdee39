"""Buildings of which only wall rectangles are known: a JSON object of walls by building."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from catalogs.faces import Face, shell_of
from catalogs.features import Fault, Model, Models, Remark
from facade_core.errors import InputError


def read_walls(path: Path, lod: str | None = None) -> Models:
    """One model per building of {"crs": ..., "walls": {building: {wall: [[x, y, z], ...]}}}, its walls as they are given.

    Corners are metres in `crs` and go around their wall; which side is outside is not known. Nothing is closed. `lod` is
    not looked at. Raises InputError where the file is no such JSON.
    """
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{path} cannot be read as JSON ({reason}); save it again") from error
    walls = content.get("walls") if isinstance(content, dict) else None
    if not isinstance(walls, dict):
        raise InputError(
            f'{path} has no walls; give {{"crs": "EPSG:n", "walls": {{building: {{wall: [[x, y, z], ...]}}}}}}'
        )
    crs = content.get("crs")
    if crs is not None and not isinstance(crs, str):
        raise InputError(f'{path}: crs is {crs!r}; give a text such as "EPSG:28992"')
    models, remarks, faults = [], [], []
    for building, stated in walls.items():
        rings = {name: _ring(corners) for name, corners in stated.items()} if isinstance(stated, dict) else {}
        broken = [name for name, ring in rings.items() if ring is None]
        flat = [name for name, ring in rings.items() if ring is not None and not _area(ring) > 1e-6]
        faces = [Face([r], "wall") for name, r in rings.items() if r is not None and name not in flat]
        shell = None if broken else shell_of(faces)
        if shell is not None:
            models.append(Model(building, shell))
            remarks += [Remark(f"{building} {name}", "walls without an area set aside", None) for name in flat]
            continue
        if broken:
            reason = (
                f"walls {', '.join(broken)} of {building} are no lists of three or more [x, y, z] numbers; mend them"
            )
        else:
            reason = f"{building} has no wall with an area; give it walls, or take it out of the file"
        points = np.concatenate([ring for ring in rings.values() if ring is not None] or [np.empty((0, 3))])
        place = shapely.box(*points[:, :2].min(axis=0), *points[:, :2].max(axis=0)) if len(points) else None
        faults.append(Fault(building, "building", reason, place))
    return Models(crs, tuple(models), remarks=tuple(remarks), faults=tuple(faults))


def _ring(corners: Any) -> np.ndarray | None:
    """(n, 3) corners of a wall without the closing one; None where they are no such numbers."""
    try:
        ring = np.asarray(corners, np.float64)
    except (TypeError, ValueError):
        return None
    if ring.ndim != 2 or ring.shape[1] != 3 or not np.isfinite(ring).all():
        return None
    ring = ring[:-1] if len(ring) > 3 and (ring[0] == ring[-1]).all() else ring
    return ring if len(ring) >= 3 else None


def _area(ring: np.ndarray) -> float:
    corners = ring - ring[0]
    return float(np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)) / 2)
