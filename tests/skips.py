"""Reasons for which tests may be skipped: a suite that skips for another fails, so that no test falls silent unseen."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

# What a machine may lack; each reason says what brings it.
KNOWN_REASONS = (
    r"no (data folder|field inputs|bad inputs)\b",
    r"no \S*/field_inputs/",
    r"val3dity\S* is not there: solids are not validated by it",
    r"no Chromium on this machine",
    r"no node on this machine",
    r"the npm package \S+ is not installed; `make clients` does that",
    r"Blender \(bpy",
    r"cjio is not installed beside Blender",
    r"no pxr here; `make usd-setup` installs it",
    r"no pycolmap here; `make sfm-setup` installs it",
    r"torch is absent: make train-setup",
    r"no encoder of KTX2; `make ktx2-setup` installs it",
    r"not installed; `make detect-setup` in Streetloom's folder installs them",
    r"no GeoVisio here",
    r"no network namespaces here",
    r"no OpenBLAS for x86-64 here",
    r"PostgreSQL does not start as root",
    r"no disk of a size can be mounted here",
    r"no other user can be taken here",
    r"this system does not let a process start its peak of memory anew",
)


def find_unknown_reasons(reasons: Iterable[str]) -> dict[str, int]:
    """Count the reasons that no pattern of KNOWN_REASONS matches."""
    return dict(Counter(reason for reason in reasons if not any(re.search(known, reason) for known in KNOWN_REASONS)))
