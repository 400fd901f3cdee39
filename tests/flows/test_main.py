"""Messages of libraries on the terminal."""

from __future__ import annotations

import subprocess
import sys

_CODE = """
import logging, warnings
from flows.__main__ import _keep_library_warnings_off_terminal
_keep_library_warnings_off_terminal()
warnings.warn("raw warning")
logging.getLogger("trimesh").warning("raw record")
logging.getLogger("rasterio._env").warning("raw record of GDAL")
logging.getLogger("flows.lease").warning("took over the lock")
"""

_WORKER = """
import logging
import catalogs.readers.gdal_files
logging.getLogger("rasterio._env").warning("raw record of GDAL")
logging.getLogger("pyogrio._io").warning("raw record of GDAL")
"""


def test_records_of_gdal_are_not_printed_by_workers() -> None:
    done = subprocess.run([sys.executable, "-c", _WORKER], capture_output=True, text=True, check=True)
    assert not done.stderr


def test_messages_of_libraries_are_not_printed() -> None:
    done = subprocess.run([sys.executable, "-W", "default", "-c", _CODE], capture_output=True, text=True, check=True)
    assert done.stderr == "took over the lock\n"
    assert not done.stdout
