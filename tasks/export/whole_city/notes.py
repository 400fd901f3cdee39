"""Notes on the blocks of a city's export, in a bounded number of lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

# Names of blocks in a note, and notes in an export; more are counted.
MAX_NAMES = 8
MAX_NOTES = 8


def list_names(names: Sequence[str]) -> str:
    """List some blocks, such as "blocks a, b"; many are counted."""
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return f"block{'s' if len(names) > 1 else ''} {', '.join(names[:MAX_NAMES])}{more}"


class PartNotes:
    """Collects the notes of parts."""

    def __init__(self) -> None:
        self._blocks: dict[str, list[str]] = {}
        self._counts: dict[str, int] = {}
        self._others = 0

    def add(self, block: str, notes: Iterable[str]) -> None:
        """Add the notes of a block."""
        for note in notes:
            if note not in self._blocks and len(self._blocks) == MAX_NOTES:
                self._others += 1
                continue
            named = self._blocks.setdefault(note, [])
            self._counts[note] = self._counts.get(note, 0) + 1
            if len(named) <= MAX_NAMES:
                named.append(block)

    def lines(self, blocks: int) -> list[str]:
        """Return the notes, each with its blocks unless all have it.

        Parameters
        ----------
        blocks : number of blocks.
        """
        lines = []
        for note, named in self._blocks.items():
            count = self._counts[note]
            more = f" and {count - MAX_NAMES} more" if count > MAX_NAMES else ""
            lines.append(note if count == blocks else f"block {', '.join(named[:MAX_NAMES])}{more}: {note}")
        if self._others:
            lines.append(f"{self._others} more notes are in the markers blocks/*/export.json")
        return lines
