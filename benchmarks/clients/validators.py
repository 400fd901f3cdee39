"""What validators of others say of exports: Khronos' of GLB. val3dity is asked by `benchmarks.solid.validated`."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from benchmarks.clients.browser import PATIENCE_S
from benchmarks.programs import INSTALLED, node, package

_CHECK = """
const {validateBytes} = require('gltf-validator'), fs = require('fs');
const paths = JSON.parse(fs.readFileSync(0, 'utf8')), options = {maxIssues: 0};
Promise.all(paths.map(f => validateBytes(new Uint8Array(fs.readFileSync(f)), options)))
  .then(reports => console.log(JSON.stringify(reports.map(r => r.issues))));
"""


def gltf_issues(*files: Path) -> list[dict[str, Any]]:
    """Of each GLB file: numErrors, numWarnings and messages, as Khronos' validator has them."""
    package("gltf-validator")
    paths = json.dumps([str(file.resolve()) for file in files])
    found = subprocess.run(
        [node(), "-e", _CHECK],
        cwd=INSTALLED,
        input=paths,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    return list(json.loads(found.stdout))
