"""Parts of a snapshot that could not be published while the others were."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from tasks.engine.outcome import error_reason, is_machine_fault, is_store_fault, machine_error

log = logging.getLogger(__name__)


@dataclass
class PartialFailures:
    """Collection of the parts that could not be published.

    Attributes
    ----------
    reasons : reason of the failure by part.
    is_store_suspect : whether a read of the store failed.
    """

    reasons: dict[str, str] = field(default_factory=dict)
    is_store_suspect: bool = False

    @contextmanager
    def attempt(self, what: str) -> Iterator[None]:
        """Record an exception of the body as the failure of a part, and go on.

        Raises
        ------
        MachineError : neither the block nor its store is at fault. A full disk, for example, fails every later part too.
        """
        try:
            yield
        except Exception as error:
            if is_machine_fault(error) and not is_store_fault(error):
                raise machine_error(f"publish {what}", error) from error
            self.is_store_suspect = self.is_store_suspect or is_store_fault(error)
            self.reasons[what] = error_reason(error)
            log.warning("%s is not published: %s", what, self.reasons[what], exc_info=error)
