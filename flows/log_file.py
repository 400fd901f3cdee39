"""Log file of each run, OUT/logs/<UTC time>.jsonl with one JSON object per line, and forwarding to Prefect's UI."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from facade_core.core.errors import FacadeError

# Root loggers of the project.
LOGGED_PACKAGES = ("facade_core", "catalogs", "tasks", "flows")

# Logs that a folder of runs keeps; a run that writes a new one removes the oldest.
MAX_KEPT_LOGS = 50
_LOG_NAMES = f"{'[0-9]' * 8}T{'[0-9]' * 6}Z.jsonl"

log = logging.getLogger(__name__)
_logged_folders: set[Path] = set()


def find_error_log(error: Exception) -> Path | None:
    """Return the log with the traceback of this error; None where no run raised it or the log could not be written."""
    path: Path | None = getattr(error, "_log", None)
    return path if path is not None and path.is_file() else None


@contextmanager
def log_to_run_folder(out: Path, *, file_only: bool = False) -> Iterator[None]:
    """Log to a new file in `out`/logs until the block ends, with the traceback of the exception that ends it; reentrant.

    The first line creates the file, and leaves the newest MAX_KEPT_LOGS.

    Parameters
    ----------
    out : folder of the run.
    file_only : do not propagate to the terminal. The outermost call decides.
    """
    out = out.resolve()
    if out in _logged_folders:
        yield
        return
    path = out / "logs" / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}.jsonl"
    handler = _JsonLineHandler(path)
    loggers = [logging.getLogger(name) for name in LOGGED_PACKAGES]
    before = [(logger.level, logger.propagate) for logger in loggers]
    for logger in loggers:
        logger.addHandler(handler)
        logger.setLevel(logging.DEBUG)
        logger.propagate = logger.propagate and not file_only
    _logged_folders.add(out)
    try:
        yield
    except FacadeError as error:
        log.error("the run ended: %s", error, exc_info=error if error.__cause__ else None)
        raise
    except Exception as error:
        log.exception("the run ended by an error of its own")
        error._log = path  # type: ignore[attr-defined]  # noqa: SLF001
        raise
    finally:
        _logged_folders.discard(out)
        for logger, (level, propagate) in zip(loggers, before, strict=True):
            logger.removeHandler(handler)
            logger.setLevel(level)
            logger.propagate = propagate


@contextmanager
def forward_log_to_prefect() -> Iterator[None]:
    """Forward warnings and errors to Prefect's server, which shows them with the flow run and its tasks."""
    from prefect.logging.handlers import APILogHandler

    handler = APILogHandler(logging.WARNING)
    for name in LOGGED_PACKAGES:
        logging.getLogger(name).addHandler(handler)
    try:
        yield
    finally:
        for name in LOGGED_PACKAGES:
            logging.getLogger(name).removeHandler(handler)


class _JsonLineHandler(logging.Handler):
    """Handler that writes each record as a line of JSON.

    Opens the file for each record, because other libraries close all handlers when they configure logging.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path

    def emit(self, record: logging.LogRecord) -> None:
        try:
            line = json.dumps(_record_fields(record), default=str)
            if not self._path.exists():
                self._path.parent.mkdir(parents=True, exist_ok=True)
                _remove_oldest_logs(self._path.parent, MAX_KEPT_LOGS - 1)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except (OSError, ValueError):  # a full disk must not end the run
            pass


def _remove_oldest_logs(folder: Path, kept: int) -> None:
    for path in sorted(folder.glob(_LOG_NAMES))[: -kept or None]:
        path.unlink(missing_ok=True)


def _record_fields(record: logging.LogRecord) -> dict[str, object]:
    fields: dict[str, object] = {
        "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
        "level": record.levelname.lower(),
        "logger": record.name,
        "message": record.getMessage(),
    }
    for name in ("stage", "unit", "worker", "started", "seconds", "traceback"):
        if (value := getattr(record, name, None)) is not None:
            fields[name] = value
    if record.exc_info and record.exc_info[0] is not None:
        fields["traceback"] = logging.Formatter().formatException(record.exc_info)
    return fields
