"""What validators of others say of exports: Khronos' of GLB. val3dity is asked by `benchmarks.solid.validated`."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from benchmarks.clients.browser import PATIENCE_S
from benchmarks.programs import INSTALLED, node, package

_CHECK = """
const {validateBytes} = require('gltf-validator'), fs = require('fs'), {dirname, join} = require('path');
const paths = JSON.parse(fs.readFileSync(0, 'utf8')), read = path => new Uint8Array(fs.readFileSync(path));
const beside = f => ({maxIssues: 0, externalResourceFunction: async uri => read(join(dirname(f), decodeURIComponent(uri)))});
Promise.all(paths.map(f => validateBytes(read(f), beside(f))))
  .then(reports => console.log(JSON.stringify(reports.map(r => r.issues))));
"""


def gltf_issues(*files: Path) -> list[dict[str, Any]]:
    """Of each GLB file, with what lies beside it: numErrors, numWarnings and messages, as Khronos' validator has them."""
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
