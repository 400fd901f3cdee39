"""What could not be published, while the rest is."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from tasks.engine.outcome import error_reason, is_machine_fault, is_store_fault, machine_error

log = logging.getLogger(__name__)


@dataclass
class PartialFailures:
    """What was tried and could not be published, with the reason; suspect: whether the store was at fault."""

    reasons: dict[str, str] = field(default_factory=dict)
    is_store_suspect: bool = False

    @contextmanager
    def attempt(self, what: str) -> Iterator[None]:
        """Set aside what fails within. Raises MachineError where neither the block nor its store is at fault: a full disk fails
        whatever is tried next."""
        try:
            yield
        except Exception as error:
            if is_machine_fault(error) and not is_store_fault(error):
                raise machine_error(f"publish {what}", error) from error
            self.is_store_suspect = self.is_store_suspect or is_store_fault(error)
            self.reasons[what] = error_reason(error)
            log.warning("%s is not published: %s", what, self.reasons[what], exc_info=error)
