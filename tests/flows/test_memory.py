"""Memory that was freed is not kept by the process."""

from __future__ import annotations

import os
import subprocess
import sys

# Whether 4 MB are mapped by themselves, by what glibc tells.
PROGRAM = """
import ctypes
from flows.memory import set_malloc_mmap_threshold

class Told(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in "arena ordblks smblks hblks hblkhd usm fsm uord ford keep".split()]

c = ctypes.CDLL(None)
c.mallinfo2.restype = Told
{call}
before = c.mallinfo2().hblks
smaller = bytes(4 << 20)
print(c.mallinfo2().hblks - before)
"""


def mapped(call: str) -> int:
    program = PROGRAM.replace("{call}", call)
    # as if so much had been freed before
    environment = os.environ | {"MALLOC_MMAP_THRESHOLD_": str(32 << 20)}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment)
    return int(done.stdout)


def test_what_is_large_is_mapped_by_itself() -> None:
    assert mapped("") == 0, "else there is nothing to be done"
    assert mapped("set_malloc_mmap_threshold()") == 1
