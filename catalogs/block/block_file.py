"""Block file as the context of errors: each error names the file and the key."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec, TypeVar

from catalogs.block.paths import hide_variable_values
from catalogs.reader_errors import is_system_error, short_message
from facade_core.core.errors import BlockFileError, FacadeError, InputError

log = logging.getLogger(__name__)

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class BlockFileErrorContext:
    """Block file as the context of errors: turns a problem with a key into a BlockFileError with the file and key."""

    path: Path

    def make_error(self, key: str, problem: str) -> BlockFileError:
        """Return the error for a problem with a key."""
        return BlockFileError(hide_variable_values(f"{self.path}: {key}: {problem}", self.path))

    def call_reader(self, key: str, read: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Call a reader, and convert its errors into BlockFileError with the file and key.

        Errors of the machine, such as a full disk, pass unchanged.
        """
        try:
            return read(*arguments, **options)
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
