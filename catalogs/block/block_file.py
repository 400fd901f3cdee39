"""The block file that is being read: every error that comes of it names it and the key."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from catalogs.reader_errors import is_system_error, short_message
from facade_core.core.errors import BlockFileError, FacadeError, InputError

log = logging.getLogger(__name__)

T = TypeVar("T")


@dataclass(frozen=True)
class BlockFile:
    """A block file, for messages."""

    path: Path

    def make_error(self, key: str, problem: str) -> BlockFileError:
        return BlockFileError(f"{self.path}: {key}: {problem}")

    def call_reader(self, key: str, read: Callable[..., T], *arguments: Any) -> T:
        """Call a reader; what it raises names the block file and the key too, whatever it is. The machine's faults pass."""
        try:
            return read(*arguments)
        except InputError as error:
            raise self.make_error(key, str(error)) from error
        except FacadeError:
            raise
        except Exception as error:
            if is_system_error(error):
                raise
            log.debug("%s: %s: refused", self.path, key, exc_info=True)
            if isinstance(error, OSError) and error.filename:
                problem = f"{error.filename} cannot be read ({error.strerror}); check the path and its permissions"
            else:
                shown = ", ".join(str(argument) for argument in arguments if isinstance(argument, str | Path))
                problem = f"{shown} cannot be used ({short_message(error)}); check it, or give another"
            raise self.make_error(key, problem) from error
