"""Harvest of a style library from unposed street pictures."""

from facade_core.imagery.detect.models import INSTALL_COMMAND

# Exemplars of a style library, by default.
MAX_EXEMPLARS = 40
# Score from which a facade is an exemplar, and the number up to which worse ones are kept where there are not as many.
MIN_SCORE = 0.4
MIN_EXEMPLARS = 3
# Fewer exemplars make all buildings of a block look alike.
FEW_EXEMPLARS = 6
# Note on a harvest without the models that detect faces and plates.
NOT_LOOKED_FOR = (
    f"faces and number plates were not detected; {INSTALL_COMMAND} installs the detectors, "
    "and the same command then harvests again"
)


def describe_weak_exemplars(count: int) -> str:
    """Return the note on exemplars that are kept for want of better ones."""
    return (
        f"{count} of the exemplars {'is' if count == 1 else 'are'} below the usual score of {MIN_SCORE:.2f}, and kept "
        f"because there are not {MIN_EXEMPLARS} better ones; add photos taken from across the street, by day"
    )


def note_few_exemplars(count: int) -> str | None:
    """Return the note on a style library of few exemplars; None for one that is large enough."""
    if count >= FEW_EXEMPLARS:
        return None
    few = "exemplar gives" if count == 1 else "exemplars give"
    return f"{count} {few} all buildings the same look; add photos of other houses, {FEW_EXEMPLARS} or more in all"
