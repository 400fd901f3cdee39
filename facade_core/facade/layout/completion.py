"""Completing a partly seen facade layout: what is proposed for the hidden part, weighed, picked and ranked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.errors import LayoutError, ModelError
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Completion, Element, Parsing
from facade_core.facade.layout.blind_layouts import sample_layouts
from facade_core.facade.layout.facade_frame import Box, fit_facade_frame
from facade_core.facade.layout.gap_filling import find_gaps_and_strays
from facade_core.facade.layout.grids import box_array, fit_grids
from facade_core.facade.layout.image_evidence import apply_image_evidence
from facade_core.facade.layout.model import LayoutModel, shipped_layout_model
from facade_core.facade.layout.proposal_features import compute_features
from facade_core.facade.layout.proposals import Proposals, propose_elements
from facade_core.facade.layout.ranking import predict_probability
from facade_core.facade.layout.rectangles import DOOR, SHOP, WINDOW, pairwise_iou, pairwise_overlap
from facade_core.facade.layout.rows import find_missing_windows, min_window_gap
from facade_core.facade.layout.scores import score
from facade_core.facade.layout.selection import align_to_lines, select_proposals
from facade_core.facade.layout.shop_floor import select_shop_row
from facade_core.facade.layout.validation import check_domain, check_elements, check_region

# An alternative picks what is this share as likely as what is picked (`examples.likely`): more, or fewer.
_THRESHOLD_FACTORS = (1.0, 0.7, 1.5, 2.0, 0.3)
# In alternatives, what one way of carrying grids on proposes is picked down to these shares of it.
_VARIANT_FACTORS = (0.4, 0.1)
# Of guesses alike, as likely to be right by half their area, that is picked on which most ways agree.
_SUPPORT_WEIGHT = 0.03
# What the picture makes less likely by this factor fills no gap.
_MIN_EVIDENCE_RATIO = 0.5
# Shops of a row come together, before what is as likely.
_GROUP_BONUS = 0.2
# A row of windows is there where its windows are this share as likely in the mean as one by itself must be; on the ground floor
# of a front, which is not bare.
_ROW_FACTOR, _GROUND_ROW_FACTOR = 0.65, 0.2
# A door that a map has is there.
_MAPPED_DOOR_PROBABILITY = 0.9
# An alternative that is like one chosen before is worth so much less.
_SIMILARITY_PENALTY = 0.5
# Weight of the statistical model beside the share that is likely right.
_SCORE_WEIGHT = 0.02


def complete(
    observed: Sequence[Element],
    domain: Box,
    observed_region: Sequence[Box],
    *,
    n: int = 1,
    seed: int = 0,
    model: LayoutModel | None = None,
    evidence: Parsing | None = None,
    entrances: Sequence[float] = (),
    front: bool = False,
) -> list[Completion]:
    """Propose up to n distinct whole layouts of a partly seen facade, best first (the task of Fan et al. 2014).

    observed: the elements seen, wholly or in part; domain: (x0, y0, x1, y1) of the facade; observed_region: boxes of
    the part that is seen; all in one unit, y down. Every completion starts with the observed elements, unchanged and
    in their order (exact duplicates once), then the proposals: inside the domain, clear of the observed region, of the
    observed elements and of each other; only a window and a balcony may overlap. evidence: a parse of the image that the
    domain covers; what it shows of a proposed element beside the occluder makes it more or less likely. entrances: where a map
    has doors, across the domain; front: on a street, where one enters: with no door in sight the likeliest is there, however
    unlikely, and beside one none but those of the map. What is proposed has as confidence how likely it is.

    Proposals come from extended, pooled and mirrored grids, doors and shops where the database has them; boosted trees say how
    likely each is, and the likely ones that do not exclude each other are picked: windows as far from each other as those seen,
    rows whole, shops all along the ground floor or none; at most one door, or as many as are seen.
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
    region = check_region(seen, domain, observed_region)
    chosen = model or shipped_layout_model()
    if not seen and len(region):
        return [Completion((), score([], domain, model=chosen))]
    if not seen:
        return _sample_completions(domain, chosen, n, seed)
    layouts = rank_layouts(seen, domain, region, chosen, evidence, alternatives=n > 1, entrances=entrances, front=front)
    return [Completion((*seen, *layout), value) for layout, value in _select_diverse(layouts, n)]


def rank_layouts(
    seen: Sequence[Element],
    domain: Box,
    region: np.ndarray,
    model: LayoutModel,
    evidence: Parsing | None,
    *,
    alternatives: bool,
    entrances: Sequence[float],
    front: bool,
) -> list[tuple[tuple[Element, ...], float]]:
    """Layouts of the hidden part with their scores, best first; the likeliest only unless alternatives are asked for."""
    things = [e for e in seen if e.label in ELEMENT_CLASSES]
    fitted = fit_grids(things)
    found = propose_elements(things, fitted, domain, region, model.usual, entrances)
    facade = fit_facade_frame(things, domain)
    likely = predict_probability(model.trees, compute_features(found, things, fitted, facade, domain, region))
    denied = np.zeros(len(likely), bool)
    if evidence is not None:
        before = likely
        likely = apply_image_evidence(likely, found.box, found.label, evidence, domain)
        denied = likely < _MIN_EVIDENCE_RATIO * before
    likely = np.where(_mapped_doors(found, entrances), np.maximum(likely, _MAPPED_DOOR_PROBABILITY), likely)
    blocked = box_array([e for e in seen if e.label not in (*ELEMENT_CLASSES, "wall")])
    wanted = model.likely[found.label]
    apart = min_window_gap(things)
    clear = _find_unobstructed(found, things, blocked, apart)
    # unlikely doors under every column would each be worth a try, and together no facade
    doors = max(1, sum(e.label == "door" for e in things), len(entrances))
    certain = np.zeros(len(likely), bool)
    if front and any(e.label == "door" for e in things):
        doors = len(entrances)
    elif front:
        certain = _likeliest_door(found, likely, clear)
    entered = _likeliest_door(found, likely, clear & (likely >= wanted)) | certain
    shops = select_shop_row(found, likely, clear, float(model.likely[SHOP]))
    better = likely + _SUPPORT_WEIGHT * found.support.mean(axis=1)
    better[shops] += _GROUP_BONUS
    better[entered] += _GROUP_BONUS

    def free(share: float) -> np.ndarray:
        """What is at least a share as likely as what is picked; of shops all of a row or none."""
        chosen = clear & (found.label != SHOP) & (likely >= share * wanted)
        if len(shops):
            chosen[shops] = likely[shops].mean() >= share * model.likely[SHOP]
        return chosen

    expected = float(likely[select_proposals(found.box, found.label, better, free(1.0), blocked, apart)].sum()) / 0.8
    choices = [(better, free(share)) for share in _THRESHOLD_FACTORS]
    # what one way of carrying on the grids proposes, before anything else
    for of_one in found.support.T:
        own = (of_one > 0.8) & (found.label != SHOP)
        choices += [(better + own, free(1.0) | (own & free(share))) for share in _VARIANT_FACTORS]
    made: dict[tuple[Element, ...], float] = {}
    done: set[bytes] = set()
    row, standing = (float(share * model.likely[WINDOW]) for share in (_ROW_FACTOR, _GROUND_ROW_FACTOR if front else _ROW_FACTOR))
    for preference, chosen in choices if alternatives else choices[:1]:
        kept = select_proposals(found.box, found.label, preference + 2 * certain, chosen | certain, blocked, apart)
        if kept.tobytes() in done:
            continue
        done.add(kept.tobytes())
        fill, alone = find_gaps_and_strays(found, kept, np.where(denied, 0, better), things, blocked)
        kept = _reselect(found, kept, fill & clear, alone, preference, blocked, apart)
        fill = find_missing_windows(found, kept, np.where(denied, 0, likely), things, clear, apart, row_threshold=row, ground_row_threshold=standing)
        kept = _reselect(found, kept, fill, np.zeros_like(fill), preference, blocked, apart)
        kept = kept[(found.label[kept] != DOOR) | (np.cumsum(found.label[kept] == DOOR) <= doors)]
        if made and not len(kept):  # to complete nothing is no alternative
            continue
        layout = align_to_lines(found, kept, likely, things, domain, region, blocked)
        right = float(likely[kept].sum())
        value = 2 * right / max(len(kept) + max(expected, right), 1e-9)
        value += _SCORE_WEIGHT * score([*things, *layout], domain, model=model)
        # the first choice is the one of largest expected F1: no alternative counts more
        made.setdefault(layout, min(value, next(iter(made.values()), value)))
    return sorted(made.items(), key=lambda item: -item[1])


def _mapped_doors(found: Proposals, entrances: Sequence[float]) -> np.ndarray:
    """(N,) bool: the proposals that are the door nearest to one of these places, and at it."""
    at = np.zeros(len(found.box), bool)
    middle, width = (found.box[:, 0] + found.box[:, 2]) / 2, found.box[:, 2] - found.box[:, 0]
    for place in entrances:
        away = np.where(found.label == DOOR, np.abs(middle - place) / width, np.inf)
        if len(away) and away.min() < 0.5:
            at[away.argmin()] = True
    return at


def _reselect(
    found: Proposals,
    kept: np.ndarray,
    fill: np.ndarray,
    alone: np.ndarray,
    preference: np.ndarray,
    blocked: np.ndarray,
    apart: float,
) -> np.ndarray:
    """What is picked without what is alone, and with what fills the rest up."""
    took = np.zeros(len(fill), bool)
    took[kept] = True
    return select_proposals(found.box, found.label, preference + 4 * took, (took & ~alone) | fill, blocked, apart)


def _find_unobstructed(found: Proposals, things: Sequence[Element], blocked: np.ndarray, apart: float) -> np.ndarray:
    """(N,) bool: the proposals that nothing stands in the way of, nor, of windows, one that is seen too near."""
    windows = box_array([e for e in things if e.label == "window"])
    grown = found.box + np.array([-apart, 0, apart, 0])
    return ~pairwise_overlap(found.box, blocked).any(axis=1) & ~((found.label == WINDOW) & pairwise_overlap(grown, windows).any(axis=1))


def _likeliest_door(found: Proposals, likely: np.ndarray, clear: np.ndarray) -> np.ndarray:
    """(N,) bool: the likeliest door that is clear, where there is one."""
    door = (found.label == DOOR) & clear
    needed = np.zeros(len(door), bool)
    if door.any():
        needed[np.where(door, likely, -1.0).argmax()] = True
    return needed


def _select_diverse(layouts: Sequence[tuple[tuple[Element, ...], float]], n: int) -> list[tuple[tuple[Element, ...], float]]:
    """The best, and then one after the other that of which score and unlikeness to those chosen are most; best first."""
    kept = [0]
    alike = np.zeros(len(layouts))
    value = np.array([value for _, value in layouts])
    while len(kept) < min(n, len(layouts)):
        last = layouts[kept[-1]][0]
        alike = np.maximum(alike, [_layout_similarity(layout, last) for layout, _ in layouts])
        worth = value - _SIMILARITY_PENALTY * alike
        worth[kept] = -np.inf
        kept.append(int(worth.argmax()))
    return [layouts[k] for k in sorted(kept)]


def _layout_similarity(a: Sequence[Element], b: Sequence[Element]) -> float:
    """The share of two layouts that is in both: elements of one label that overlap by half their union."""
    if not a or not b:
        return float(len(a) == len(b))
    label = [np.array([ELEMENT_CLASSES.index(e.label) for e in layout]) for layout in (a, b)]
    same = (pairwise_iou(box_array(a), box_array(b)) >= 0.5) & (label[0][:, None] == label[1])
    return 2 * float(same.any(axis=1).sum()) / (len(a) + len(b))


def _sample_completions(domain: Box, model: LayoutModel, n: int, seed: int) -> list[Completion]:
    rng = np.random.default_rng([seed % 2**31, 3])
    layouts = [tuple(layout) for layout in sample_layouts(domain, model.styles, model.metric, 12 + 2 * n, rng)]
    made = [Completion(layout, score(layout, domain, model=model)) for layout in dict.fromkeys(layouts)]
    return sorted(made, key=lambda completion: -completion.score)[:n]
