"""Complete a partly observed facade layout: propose, rate, select and rank elements of its hidden part."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.errors import LayoutError, ModelFileError
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Completion, Element, Parsing
from facade_core.facade.layout.facade_frame import Rectangle, fit_columns_and_floors
from facade_core.facade.layout.gap_filling import find_fillers_and_strays, remove_lone_balconies
from facade_core.facade.layout.grids import box_array, fit_grids
from facade_core.facade.layout.image_evidence import apply_image_evidence
from facade_core.facade.layout.layout_sampling import sample_layouts
from facade_core.facade.layout.model import LayoutModel, default_layout_model
from facade_core.facade.layout.network.windows import (
    MIN_WINDOW_PROBABILITY,
    find_network_windows,
    load_layout_network,
    move_to_proposals,
)
from facade_core.facade.layout.proposal_features import compute_features
from facade_core.facade.layout.proposals import Proposals, avoids_observed, move_clear, propose_elements
from facade_core.facade.layout.ranking import predict_probability
from facade_core.facade.layout.rectangles import DOOR, SHOP, WINDOW, overlap_mask, pairwise_iou
from facade_core.facade.layout.scores import score
from facade_core.facade.layout.selection import PlacementSpace, align_proposal_edges, select_proposals
from facade_core.facade.layout.shop_floor import select_shop_row
from facade_core.facade.layout.validation import check_domain, check_elements, check_region
from facade_core.facade.layout.visible_region import is_middle_hidden
from facade_core.facade.layout.window_rows import RowLimits, find_missing_windows, min_window_gap

# Alternatives select proposals from these multiples of the selection thresholds.
_THRESHOLD_FACTORS = (1.0, 0.7, 1.5, 2.0, 0.3)
# Alternatives that prefer one variant select its proposals from these multiples of the thresholds.
_VARIANT_FACTORS = (0.4, 0.1)
# Weight of the mean support of the variants: it decides between similar guesses of equal probability.
_SUPPORT_WEIGHT = 0.03
# Proposals whose probability the picture lowers by more than this factor fill no gap.
_MIN_EVIDENCE_RATIO = 0.5
# Added to the preference of a row of shops and of a needed door, which precede proposals of equal probability.
_GROUP_BONUS = 0.2
# A row of windows is added from these multiples of the threshold of a single window, as the mean of its windows.
_ROW_FACTOR = 0.65
# The same for the ground floor of a wall on a street, which is not bare.
_GROUND_ROW_FACTOR = 0.2
# Thresholds are multiplied by this where the middle is hidden: between two visible parts doubt left it empty.
_MIDDLE_FACTOR = 0.5
# Least probability of a mapped door.
_MAPPED_DOOR_PROBABILITY = 0.9
# Penalty of an alternative for its similarity to those already chosen.
_SIMILARITY_PENALTY = 0.5
# Weight of the statistical score against the expected F1.
_SCORE_WEIGHT = 0.02


def complete(
    observed: Sequence[Element],
    domain: Rectangle,
    observed_region: Sequence[Rectangle],
    *,
    n: int = 1,
    seed: int = 0,
    model: LayoutModel | None = None,
    evidence: Parsing | None = None,
    entrances: Sequence[float] = (),
    front: bool = False,
) -> list[Completion]:
    """Propose up to n distinct whole layouts of a partly observed facade, best first.

    Every completion starts with the observed elements, unchanged and in their order (exact duplicates once). The
    proposals follow: inside the domain, clear of the observed region, of the observed elements and of each other.
    Only a window and a balcony may overlap. The confidence of a proposed element is its probability.

    Proposals come from extended, pooled and mirrored grids; doors and shops also from places where the database has
    them. Boosted trees rate each proposal, and the likely ones that do not exclude each other are selected. The layout
    network of the model finds the windows of the first layout instead (docs/decisions/0088). Windows keep the smallest
    observed distance, rows are completed, and shops fill the ground floor or are absent. A layout has at most one
    door, or as many as are observed. The policy search of the layout paper (5.1-5.2) adds nothing to that and does
    not run (docs/decisions/0088). The score of a completion is the expected F1 of its selection, plus a small share of `score`
    (Eq. 15).

    Without any element or region, whole layouts are sampled in the styles of the database and ranked by `score`; only
    they depend on the seed. A region without elements is a bare wall and is returned as such.

    Parameters
    ----------
    observed : elements seen, wholly or in part.
    domain : (x0, y0, x1, y1) of the facade; all coordinates share its unit, y down.
    observed_region : boxes of the visible part.
    n : largest number of completions.
    seed : seed of sampled layouts.
    model : the shipped layout model by default.
    evidence : parse of the image that the domain covers; the visible pixels of a proposal change its probability.
    entrances : positions of mapped doors along the domain.
    front : True for a wall on a street. Without an observed door its likeliest door is then always selected; with
        one, only the mapped doors are added.

    Raises
    ------
    LayoutError
        For an element without area, of an unknown label, centred outside the domain or outside the observed region,
        and for a box without area or outside the domain.

    References
    ----------
    Fan et al. 2014 (layout paper).
    """
    if model is not None and not isinstance(model, LayoutModel):
        raise ModelFileError(
            "layout.complete: model must be a LayoutModel; read one with streetloom.layout.load_layout_model"
        )
    if n < 1:
        raise LayoutError(f"layout.complete: n must be at least 1, not {n}")
    check_domain(domain)
    seen = list(dict.fromkeys(observed))
    check_elements(seen, domain)
    region = check_region(seen, domain, observed_region)
    chosen = model or default_layout_model()
    if not seen and len(region):
        return [Completion((), score([], domain, model=chosen))]
    if not seen:
        return _sample_completions(domain, chosen, n, seed)
    layouts = propose_ranked_layouts(
        seen, domain, region, chosen, evidence, alternatives=n > 1, entrances=entrances, front=front
    )
    return [Completion((*seen, *layout), value) for layout, value in _select_diverse(layouts, n)]


def propose_ranked_layouts(
    seen: Sequence[Element],
    domain: Rectangle,
    region: Float64Array,
    model: LayoutModel,
    evidence: Parsing | None,
    *,
    alternatives: bool,
    entrances: Sequence[float],
    front: bool,
) -> list[tuple[tuple[Element, ...], float]]:
    """Propose layouts of the hidden part and return them with their scores, best first.

    Parameters
    ----------
    seen : observed elements of any label.
    region : (M, 4) visible boxes.
    alternatives : False to return the likeliest layout only.
    entrances, front, evidence : as in `complete`.
    """
    observed = [e for e in seen if e.label in ELEMENT_CLASSES]
    fitted = fit_grids(observed)
    proposals = propose_elements(observed, fitted, domain, region, model.priors, entrances)
    facade = fit_columns_and_floors(observed, domain)
    features = compute_features(proposals, observed, fitted, facade, domain, region)
    probability = predict_probability(model.trees, features)
    proposals, probability, by_network = _add_network_windows(proposals, probability, observed, domain, region, model)
    contradicted = np.zeros(len(probability), bool)
    if evidence is not None:
        prior = probability
        probability = apply_image_evidence(probability, proposals.box, proposals.label, evidence, domain)
        contradicted = probability < _MIN_EVIDENCE_RATIO * prior
    mapped = _mapped_doors(proposals, entrances)
    probability = np.where(mapped, np.maximum(probability, _MAPPED_DOOR_PROBABILITY), probability)
    obstacles = box_array([e for e in seen if e.label not in (*ELEMENT_CLASSES, "wall")])
    min_probability = model.min_probability * (_MIDDLE_FACTOR if is_middle_hidden(region, domain) else 1.0)
    threshold = min_probability[proposals.label]
    min_gap = min_window_gap(observed)
    unobstructed = _find_unobstructed(proposals, observed, obstacles, min_gap)
    # Unlikely doors under every column would each be worth a try, but together they form no facade.
    max_doors = max(1, sum(e.label == "door" for e in observed), len(entrances))
    certain = np.zeros(len(probability), bool)
    if front and any(e.label == "door" for e in observed):
        max_doors = len(entrances)
    elif front:
        certain = _likeliest_door(proposals, probability, unobstructed)
    doors = _likeliest_door(proposals, probability, unobstructed & (probability >= threshold)) | certain
    shops = select_shop_row(proposals, probability, unobstructed, float(min_probability[SHOP]))
    preference = probability + _SUPPORT_WEIGHT * proposals.support.mean(axis=1)
    preference[shops] += _GROUP_BONUS
    preference[doors] += _GROUP_BONUS

    def selectable(factor: float) -> BoolArray:
        """Mark proposals from a multiple of their thresholds on; shops of a row all or none."""
        chosen: BoolArray = unobstructed & (proposals.label != SHOP) & (probability >= factor * threshold)
        chosen &= ~by_network
        if len(shops):
            chosen[shops] = probability[shops].mean() >= factor * min_probability[SHOP]
        return chosen

    def select(order: Float64Array, allowed: BoolArray) -> Int64Array:
        """Select among allowed proposals by preference."""
        return select_proposals(proposals.box, proposals.label, order, allowed, obstacles, min_gap)

    first = select(preference, selectable(1.0))
    expected = float(probability[first].sum()) / 0.8
    choices = [(preference, selectable(factor)) for factor in _THRESHOLD_FACTORS]
    if by_network.any():
        likely = by_network & unobstructed & (probability >= MIN_WINDOW_PROBABILITY)
        choices.insert(0, (preference, np.where(proposals.label == WINDOW, likely, choices[0][1])))
    for support in proposals.support.T:
        preferred = (support > 0.8) & (proposals.label != SHOP)
        choices += [
            (preference + preferred, selectable(1.0) | (preferred & selectable(factor))) for factor in _VARIANT_FACTORS
        ]
    layouts: dict[tuple[Element, ...], float] = {}
    tried: set[bytes] = set()
    row_threshold, ground_row_threshold = (
        float(factor * min_probability[WINDOW])
        for factor in (_ROW_FACTOR, _GROUND_ROW_FACTOR if front else _ROW_FACTOR)
    )
    limits = RowLimits(min_gap, row_threshold, ground_row_threshold)
    for order, chosen in choices if alternatives else choices[:1]:
        selected = select(order + 2 * certain, chosen | certain)
        if selected.tobytes() in tried:
            continue
        tried.add(selected.tobytes())
        if not by_network[selected].any():
            excluded = contradicted | by_network
            fill, strays = find_fillers_and_strays(
                proposals, selected, np.where(excluded, 0, preference), observed, obstacles
            )
            selected = _reselect(select, selected, fill & unobstructed, strays, order)
            fill = find_missing_windows(
                proposals, selected, np.where(excluded, 0, probability), observed, unobstructed, limits
            )
            selected = _reselect(select, selected, fill, np.zeros_like(fill), order)
        is_door = proposals.label[selected] == DOOR
        selected = selected[~is_door | (np.cumsum(is_door) <= max_doors)]
        layout = align_proposal_edges(
            proposals, selected, probability, observed, PlacementSpace(domain, region, obstacles)
        )
        layout = remove_lone_balconies(layout, observed)
        if layouts and not layout:  # an empty completion is no alternative
            continue
        correct = float(probability[selected].sum())
        value = 2 * correct / max(len(selected) + max(expected, correct), 1e-9)
        value += _SCORE_WEIGHT * score([*observed, *layout], domain, model=model)
        # The first choice has the largest expected F1, so it bounds the value of the alternatives.
        layouts.setdefault(layout, min(value, next(iter(layouts.values()), value)))
    return sorted(layouts.items(), key=lambda item: -item[1])


def _add_network_windows(
    proposals: Proposals,
    probability: Float64Array,
    observed: Sequence[Element],
    domain: Rectangle,
    region: Float64Array,
    model: LayoutModel,
) -> tuple[Proposals, Float64Array, BoolArray]:
    """Return proposals and probabilities with the windows of the layout network after them, and mark these, (N,)."""
    found = None
    if model.network is not None:
        found = find_network_windows(observed, domain, region, load_layout_network(model.network))
    if found is None:
        return proposals, probability, np.zeros(len(probability), bool)
    box, is_clear = move_clear(found.box, domain, region)
    is_clear &= avoids_observed(np.column_stack([np.full(len(box), WINDOW), box]), observed)
    box, chance = box[is_clear], found.probability[is_clear]
    own = proposals.label == WINDOW
    box = move_to_proposals(box, proposals.box[own], probability[own])
    added = Proposals(
        np.concatenate([proposals.box, box]),
        np.concatenate([proposals.label, np.full(len(box), WINDOW, proposals.label.dtype)]),
        np.concatenate([proposals.support, np.zeros((len(box), proposals.support.shape[1]), np.float32)]),
    )
    return added, np.concatenate([probability, chance]), np.arange(len(added.box)) >= len(probability)


def _mapped_doors(proposals: Proposals, entrances: Sequence[float]) -> BoolArray:
    """Mark, (N,) bool, the proposed door nearest to each mapped entrance and within half its width."""
    mapped = np.zeros(len(proposals.box), bool)
    middle = (proposals.box[:, 0] + proposals.box[:, 2]) / 2
    width = proposals.box[:, 2] - proposals.box[:, 0]
    for entrance in entrances:
        distance = np.where(proposals.label == DOOR, np.abs(middle - entrance) / width, np.inf)
        if len(distance) and distance.min() < 0.5:
            mapped[distance.argmin()] = True
    return mapped


def _reselect(
    select: Callable[[Float64Array, BoolArray], Int64Array],
    selected: Int64Array,
    fill: BoolArray,
    strays: BoolArray,
    preference: Float64Array,
) -> Int64Array:
    """Select again: the previous selection without its strays, and the proposals that fill its gaps."""
    before = np.zeros(len(fill), bool)
    before[selected] = True
    selectable = (before & ~strays) | fill
    return select(preference + 4 * before, selectable)


def _find_unobstructed(
    proposals: Proposals, observed: Sequence[Element], obstacles: Float64Array, min_gap: float
) -> BoolArray:
    """Mark, (N,) bool, the proposals clear of obstacles and, for windows, not too near to an observed one."""
    windows = box_array([e for e in observed if e.label == "window"])
    grown = proposals.box + np.array([-min_gap, 0, min_gap, 0])
    near_window = (proposals.label == WINDOW) & overlap_mask(grown, windows).any(axis=1)
    is_unobstructed: BoolArray = ~overlap_mask(proposals.box, obstacles).any(axis=1) & ~near_window
    return is_unobstructed


def _likeliest_door(proposals: Proposals, probability: Float64Array, unobstructed: BoolArray) -> BoolArray:
    """Mark, (N,) bool, the likeliest unobstructed door, if any."""
    door = (proposals.label == DOOR) & unobstructed
    likeliest = np.zeros(len(door), bool)
    if door.any():
        likeliest[np.where(door, probability, -1.0).argmax()] = True
    return likeliest


def _select_diverse(
    layouts: Sequence[tuple[tuple[Element, ...], float]], n: int
) -> list[tuple[tuple[Element, ...], float]]:
    """Select the best layout, then greedily those of high score and low similarity; best first."""
    selected = [0]
    similarity = np.zeros(len(layouts))
    value = np.array([value for _, value in layouts])
    while len(selected) < min(n, len(layouts)):
        last = layouts[selected[-1]][0]
        similarity = np.maximum(similarity, [_layout_similarity(layout, last) for layout, _ in layouts])
        worth = value - _SIMILARITY_PENALTY * similarity
        worth[selected] = -np.inf
        selected.append(int(worth.argmax()))
    return [layouts[k] for k in sorted(selected)]


def _layout_similarity(a: Sequence[Element], b: Sequence[Element]) -> float:
    """Return the share of elements common to two layouts: equal label and IoU of at least one half."""
    if not a or not b:
        return float(len(a) == len(b))
    label = [np.array([ELEMENT_CLASSES.index(e.label) for e in layout]) for layout in (a, b)]
    same = (pairwise_iou(box_array(a), box_array(b)) >= 0.5) & (label[0][:, None] == label[1])
    return 2 * float(same.any(axis=1).sum()) / (len(a) + len(b))


def _sample_completions(domain: Rectangle, model: LayoutModel, n: int, seed: int) -> list[Completion]:
    rng = np.random.default_rng([seed % 2**31, 3])
    layouts = [tuple(layout) for layout in sample_layouts(domain, model.styles, model.metric_pitches, 12 + 2 * n, rng)]
    completions = [Completion(layout, score(layout, domain, model=model)) for layout in dict.fromkeys(layouts)]
    return sorted(completions, key=lambda completion: -completion.score)[:n]
