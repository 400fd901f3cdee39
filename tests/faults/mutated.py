"""Run on its own: reads mutations of files; a line for each that ends in anything but a result or a refusal, and one a file."""

from __future__ import annotations

import random
import resource
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

NUMBERS = (
    b"0",
    b"-1",
    b"1e300",
    b"NaN",
    b"99999999999999999999",
    b"1" * 400,
    b'"x"',
    b"null",
    b"[]",
    b"{}",
    b"4294967295",
)


def mutations(data: bytes, seed: int, count: int) -> Iterator[bytes]:
    """Bytes flipped, cut, doubled, zeroed and overwritten, and numbers of a text exchanged."""
    dice = random.Random(seed)
    for _ in range(count):
        found = bytearray(data)
        for _ in range(dice.choice((1, 1, 1, 2, 4, 16))):
            place = dice.randrange(len(found)) if found else 0
            length = dice.choice((1, 2, 4, 8, 64, 512))
            match dice.randrange(8):
                case 0:
                    found[place : place + 1] = bytes([dice.randrange(256)])
                case 1:
                    found[place : place + 1] = bytes([found[place] ^ 1 << dice.randrange(8)]) if found else b""
                case 2:
                    del found[place : None if dice.random() < 0.3 else place + length]
                case 3:
                    found[place:place] = found[place : place + length]
                case 4:
                    found[place : place + length] = b"\0" * length
                case 5:
                    found[place : place + 4] = dice.choice((b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80"))
                case 6:
                    other = dice.randrange(len(found)) if found else 0
                    found[place : place + length] = found[other : other + length]
                case _:
                    digits = [i for i in range(place, min(place + 200, len(found))) if chr(found[i]).isdigit()]
                    if digits:
                        end = digits[0]
                        while end < len(found) and chr(found[end]).isdigit():
                            end += 1
                        found[digits[0] : end] = dice.choice(NUMBERS)
        yield bytes(found)


def main(kind: str, seed: int, count: int, files: list[Path]) -> None:
    """Mutates each file, and those beside it that belong to it (a .dbf, a .bin), in turn."""
    from catalogs.readers.formats import read_buildings, read_centrelines
    from facade_core.core.errors import FacadeError

    warnings.simplefilter("ignore")
    readers: dict[str, Callable[[Path], object]] = {"buildings": read_buildings, "streets": read_centrelines}
    for file in files:
        if (read := readers.get(kind)) is None:
            from small_files import SMALL_FILES

            read = SMALL_FILES[file.name].read
        sound = {path: path.read_bytes() for path in sorted(file.parent.iterdir())}
        read(file)
        limit = resource.getrlimit(resource.RLIMIT_AS)
        now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + 2**30, limit[1]))
        names = [path for path in sound if path == file or path.suffix in (".dbf", ".shx", ".bin")]
        turns = [mutations(sound[path], seed + index, count) for index, path in enumerate(names)]
        for number in range(count):
            path = names[0 if number % 2 else number // 2 % len(names)] if len(names) > 1 else file
            for other, data in sound.items():
                other.write_bytes(data)
            path.write_bytes(next(turns[names.index(path)]))
            signal.alarm(20)  # ends the process where a reader does not
            try:
                read(file)
            except FacadeError as error:
                text = str(error)
                named = any(name.stem in text for name in (path, file, file.parent))
                has_remedy = ";" in text or file.suffix == ".yaml"  # whose keys' values are named with their range
                if len(text.splitlines()) != 1 or not named or not has_remedy or len(text) > 1000:
                    print(f"{file.name} {number}: {text!r}", flush=True)
            except BaseException as error:  # that is what is looked for
                where = traceback.extract_tb(error.__traceback__)[-1]
                print(
                    f"{file.name} {number}: {type(error).__name__}: {str(error)[:200]} at {where.filename}:{where.lineno}",
                    flush=True,
                )
            signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, limit)
        print(f"{file}: {count}", flush=True)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), [Path(name) for name in sys.argv[4:]])
