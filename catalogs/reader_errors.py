"""Conversion of parser errors into input errors.

A broken file is rejected and a broken unit becomes a fault. Errors of the machine, such as a full disk, pass through.
"""

from __future__ import annotations

import errno
import json
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from facade_core.core.errors import FacadeError, InputError

log = logging.getLogger(__name__)

# Errors of a full, broken or exhausted machine.
_SYSTEM_ERRNOS = frozenset(
    (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EROFS, errno.ESTALE)
)
# A smaller file exhausts memory only with false sizes in its header.
_SMALL_FILE_BYTES = 64 * 2**20
_MAX_MESSAGE_LENGTH = 160
_OTHER_CONTENT = "its content is not arranged as in this format"
# Words of Python and numpy, and what they say of a file.
_PLAIN_WORDS = (
    (r"embedded null (?:byte|character)", "it holds a null character"),
    (r"Exceeds the limit .*", "a number has thousands of digits"),
    (r"could not convert string to float: (.*)", r"\1 is no number"),
    (r"invalid literal for int\(\) with base \d+: (.*)", r"\1 is no whole number"),
    (r"(?:not enough|too many) values to unpack.*", "a list has another number of values than it must"),
    (r"cannot convert float (?:NaN|infinity) to integer.*", "a whole number is not finite"),
    (r"setting an array element with a sequence.*|.*inhomogeneous shape.*", "rows of numbers differ in length"),
    (r"cannot reshape array.*|operands could not be broadcast.*|all the input array.*", "arrays differ in size"),
    (r"buffer (?:is smaller|size must).*|.*unpack(?:_from)? requires a buffer.*", "it is truncated"),
    (r"Object arrays cannot be loaded.*|.*allow_pickle.*", "it holds Python objects, which are not read"),
    (r"zero-size array.*|need at least one array.*|max\(\) arg is an empty.*|min\(\) arg is an empty.*", "it holds no values"),
)  # fmt: skip


_WORDS_BY_CLASS = {
    (RecursionError,): "it is nested too deeply",
    (UnicodeEncodeError,): "it holds letters that cannot be encoded",
    (OverflowError, ZeroDivisionError, FloatingPointError): "a number is too large",
    (AssertionError, KeyError, IndexError, AttributeError, TypeError): _OTHER_CONTENT,
}


def is_system_error(error: BaseException) -> bool:
    """Return True where an error is the fault of the machine and not of the input."""
    if isinstance(error, OSError):
        return error.errno in _SYSTEM_ERRNOS
    return isinstance(error, MemoryError | ImportError) or not isinstance(error, Exception)


def short_message(error: BaseException) -> str:
    """Return the message of an error as a short part of one line, without the words of Python for its own errors."""
    return to_single_line(_plain_message(error))[:_MAX_MESSAGE_LENGTH].strip() or _OTHER_CONTENT


def _plain_message(error: BaseException) -> str:
    match error:
        case FacadeError():
            return str(error)

        case json.JSONDecodeError():
            return f"{error.msg.lower()} at line {error.lineno}, column {error.colno}"
        case UnicodeDecodeError():
            return f"it is no {error.encoding.upper()} text"

        case OSError() if error.strerror:
            return error.strerror
        case KeyError(args=(str() as key, *_)):
            return f"{key[:60]!r} is missing"
    for classes, words in _WORDS_BY_CLASS.items():
        if isinstance(error, classes):
            return words
    text = " ".join(str(error).split())
    for pattern, words in _PLAIN_WORDS:
        if found := re.fullmatch(pattern, text):
            return found.expand(words)
    return text


def to_single_line(text: str) -> str:
    """Return a text as part of one UTF-8 line, with a space for each unprintable character."""
    return "".join(c if c.isprintable() else " " for c in text.encode(errors="replace").decode()).strip()


@contextmanager
def wrap_reader_errors(path: Path | str, problem: str, remedy: str) -> Iterator[None]:
    """Raise errors of parsers as InputError.

    Errors of the project and of the machine pass unchanged.

    Parameters
    ----------
    path : file that the wrapped block reads, or its name.
    problem : what the message says of the file, such as "is not a valid .obj file".
    remedy : advice to the user at the end of the message.

    Raises
    ------
    InputError
        One line with the file, the reason and the remedy.
    """
    try:
        yield
    except Exception as error:  # parsers raise errors of any class
        is_claim = isinstance(error, MemoryError) and _file_size(path) < _SMALL_FILE_BYTES
        if isinstance(error, FacadeError) or (is_system_error(error) and not is_claim):
            raise
        log.debug("%s: refused", path, exc_info=True)
        if is_claim:  # `from None`: the memory is not at fault
            raise InputError(f"{path} claims to hold more than memory can; {remedy}") from None
        if isinstance(error, OSError) and error.strerror and error.filename is not None:
            check = "path" if isinstance(error, FileNotFoundError) else "permissions"
            raise InputError(f"{path} cannot be read ({error.strerror}); check its {check}") from error
        raise InputError(f"{path} {problem} ({short_message(error)}); {remedy}") from error


def fault_reason(error: Exception, remedy: str = "mend or remove it") -> str:
    """Return the reason and the remedy of a fault for an error of any class.

    Raises
    ------
    Exception
        The given error, where it is an error of the machine.
    """
    if is_system_error(error):
        raise error
    if isinstance(error, FacadeError):
        return str(error)
    log.debug("a unit is set aside", exc_info=error)
    return f"it cannot be read ({short_message(error)}); {remedy}"


def _file_size(path: Path | str) -> int:
    try:
        return Path(path).stat().st_size
    except OSError:
        return 0
