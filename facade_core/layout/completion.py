"""Completing a partly seen facade layout: what is proposed for the hidden part, weighed, picked and ranked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.errors import LayoutError, ModelError
from facade_core.labels import ELEMENT_CLASSES
from facade_core.layout.checks import check_domain, check_elements, checked_region
from facade_core.layout.descriptors import describe
from facade_core.layout.evidence import weighed
from facade_core.layout.grids import boxes, grids
from facade_core.layout.model import LayoutModel, shipped
from facade_core.layout.picking import aligned, pick
from facade_core.layout.proposals import Box, frame, propose
from facade_core.layout.ranking import probability
from facade_core.layout.rectangles import DOOR
from facade_core.layout.scores import score
from facade_core.layout.styles import sample_layouts
from facade_core.types import Completion, Element, Parsing

# A window, balcony, door or shop is picked when it is likelier than this: about half of the F1 that is reached for its
# label, where F1 is largest. Alternatives pick more, and fewer.
_LIKELY = np.array([0.25, 0.15, 0.09, 0.11])
_SHARES = (1.0, 0.7, 1.5, 2.0, 0.3, 8.0)
# In an alternative, what one way of carrying grids on proposes is picked down to this share of it.
_DOUBTED = 0.4
# Two completions are distinct when at least this share of their proposals differs.
_DISTINCT = 0.08
# Weight of the statistical model beside the share that is likely right.
_PLAUSIBLE = 0.02


def complete(
    observed: Sequence[Element],
    domain: Box,
    observed_region: Sequence[Box],
    *,
    n: int = 1,
    seed: int = 0,
    model: LayoutModel | None = None,
    evidence: Parsing | None = None,
) -> list[Completion]:
    """Propose up to n distinct whole layouts of a partly seen facade, best first (the task of Fan et al. 2014).

    observed: the elements seen, wholly or in part; domain: (x0, y0, x1, y1) of the facade; observed_region: boxes of
    the part that is seen; all in one unit, y down. Every completion starts with the observed elements, unchanged and
    in their order (exact duplicates once), then the proposals: inside the domain, clear of the observed region, of the
    observed elements and of each other; only a window and a balcony may overlap. evidence: a parse of the image that the
    domain covers; what it shows of a proposed element beside the occluder makes it more or less likely.

    Proposals come from extended, pooled and mirrored grids, doors and shops where the database has them; boosted trees say how
    likely each is, and the likely ones that do not exclude each other are picked; at most one door, or as many as are seen.
    The policy search of the paper (5.1-5.2) adds nothing to that and is not asked (ADR 0088). The score is the expected
    F1 of what was picked, plus a small share of `score` (Eq. 15). With neither an element nor a region, whole layouts are
    sampled in the styles of the database and ranked by `score`; for them alone the seed counts. No element in a seen region
    is a bare wall, returned as such.

    Raises LayoutError for an element without area, of an unknown label, centred outside the domain or outside the observed
    region, and for a box without area or outside the domain.
    """
    if model is not None and not isinstance(model, LayoutModel):
        raise ModelError("layout.complete: model must be a LayoutModel; read one with facade_core.layout.load")
    if n < 1:
        raise LayoutError(f"layout.complete: n must be at least 1, not {n}")
    check_domain(domain)
    seen = list(dict.fromkeys(observed))
    check_elements(seen, domain)
    region = checked_region(seen, domain, observed_region)
    chosen = model or shipped()
    if not seen and len(region):
        return [Completion((), score([], domain, model=chosen))]
    if not seen:
        return _imagined(domain, chosen, n, seed)
    layouts = candidates(seen, domain, region, chosen, evidence=evidence, alternatives=n > 1)
    return [Completion((*seen, *layout), value) for layout, value in _distinct(layouts, n)]


def candidates(
    seen: Sequence[Element],
    domain: Box,
    region: np.ndarray,
    model: LayoutModel,
    *,
    evidence: Parsing | None,
    alternatives: bool,
) -> list[tuple[tuple[Element, ...], float]]:
    """Layouts of the hidden part with their scores, best first; the likeliest only unless alternatives are asked for."""
    things = [e for e in seen if e.label in ELEMENT_CLASSES]
    fitted = grids(things)
    found = propose(things, fitted, domain, region, model.sizes)
    facade = frame(things, domain)
    likely = probability(model.trees, describe(found, things, fitted, facade, domain, region))
    if evidence is not None:
        likely = weighed(likely, found.box, found.label, evidence, domain)
    blocked = boxes([e for e in seen if e.label not in (*ELEMENT_CLASSES, "wall")])
    wanted = _LIKELY[found.label]
    expected = float(likely[pick(found.box, found.label, likely, likely >= wanted, blocked)].sum()) / 0.8
    choices = [(likely, likely >= share * wanted) for share in _SHARES]
    # what one way of carrying on the grids proposes, before anything else
    for of_one in found.support.T:
        own = of_one > 0.8
        choices.append((likely + own, (likely >= wanted) | (own & (likely >= _DOUBTED * wanted))))
    # unlikely doors under every column would each be worth a try, and together no facade
    doors = max(1, sum(e.label == "door" for e in things))
    made: dict[tuple[Element, ...], float] = {}
    for preference, free in choices if alternatives else choices[:1]:
        kept = pick(found.box, found.label, preference, free, blocked)
        kept = kept[(found.label[kept] != DOOR) | (np.cumsum(found.label[kept] == DOOR) <= doors)]
        layout = aligned(found, kept, likely, things, domain, region, blocked)
        right = float(likely[kept].sum())
        value = 2 * right / max(len(kept) + max(expected, right), 1e-9)
        value += _PLAUSIBLE * score([*things, *layout], domain, model=model)
        # the first choice is the one of largest expected F1: no alternative counts more
        made.setdefault(layout, min(value, next(iter(made.values()), value)))
    return sorted(made.items(), key=lambda item: -item[1])


def _distinct(layouts: Sequence[tuple[tuple[Element, ...], float]], n: int) -> list[tuple[tuple[Element, ...], float]]:
    """The first n that differ from each other in more than a few elements; the others fill up what is missing."""
    kept: list[int] = []
    sets = [frozenset(layout) for layout, _ in layouts]
    for k, own in enumerate(sets):
        if len(kept) < n and all(len(own ^ sets[j]) > _DISTINCT * len(own | sets[j]) for j in kept):
            kept.append(k)
    kept += [k for k in range(len(sets)) if k not in kept][: n - len(kept)]
    return [layouts[k] for k in sorted(kept)]


def _imagined(domain: Box, model: LayoutModel, n: int, seed: int) -> list[Completion]:
    rng = np.random.default_rng([seed % 2**31, 3])
    layouts = [tuple(layout) for layout in sample_layouts(domain, model.styles, model.metric, 12 + 2 * n, rng)]
    made = [Completion(layout, score(layout, domain, model=model)) for layout in dict.fromkeys(layouts)]
    return sorted(made, key=lambda completion: -completion.score)[:n]
