"""The shape of an atlas."""

from __future__ import annotations

from dataclasses import dataclass

from facade_core.errors import StoreError


@dataclass(frozen=True)
class AtlasSpec:
    """Pages of page x page texels in chunks of chunk x chunk; a gutter of replicated texels around every chart."""

    pages: int
    texels_per_metre: float
    page: int = 2048
    chunk: int = 128
    gutter: int = 2

    def __post_init__(self) -> None:
        if self.page % self.chunk:
            raise StoreError(
                f"a page of {self.page} texels is not a whole number of chunks of {self.chunk}; change either"
            )
        if self.pages < 1 or self.texels_per_metre <= 0 or not 0 <= self.gutter < self.chunk // 2:
            raise StoreError(f"unusable atlas: {self}; it needs a page, a density and a gutter below half a chunk")

    @property
    def largest(self) -> float:
        """The longest side in metres of a chart that still fits a page with its gutters."""
        return (self.page - 2 * self.gutter) / self.texels_per_metre - 1e-6
