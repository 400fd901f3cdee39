"""Learn the layout model from a database of whole layouts (Fan et al. 2014, section 4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.papers.policy import roll_out_policy
from benchmarks.papers.policy_optimisation import (
    POLICY_POPULATION,
    evolve_policy_candidates,
    observed_layout_arrays,
    sample_policies,
)
from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.errors import LayoutError
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout import statistics as st
from facade_core.facade.layout.densities import (
    ALIGN_X_ROW,
    ALIGN_Y_ROW,
    BOTTOM_BORDER_ROW,
    COMPLETENESS_ROW,
    COMPONENT_COUNT,
    COVERAGE_ROW,
    DOOR_BINS,
    HEIGHT_RATIO_ROW,
    MIN_LOG_DENSITY,
    MIXTURE_COUNT,
    REGULAR_X_ROW,
    REGULAR_Y_ROW,
    SIDE_BORDER_ROW,
    SYMMETRY_BINS,
    TERMS,
    TOP_BORDER_ROW,
    WIDTH_RATIO_ROW,
    ScoreTermDensities,
)
from facade_core.facade.layout.facade_frame import ColumnsAndFloors, Rectangle, fit_columns_and_floors
from facade_core.facade.layout.grids import box_array
from facade_core.facade.layout.model import POLICY_LENGTH, LayoutModel
from facade_core.facade.layout.proposals import ElementPriors
from facade_core.facade.layout.ranking import BoostedTrees
from facade_core.facade.layout.scores import door_bin, layout_score_terms, measure_layout_from_elements
from facade_core.facade.layout.statistics import LABEL_COUNT, PATTERNS
from tasks.engine.progress import begin_stage, report_progress
from training.layout import cases as training_cases
from training.layout.ranking_examples import (
    Layout,
    choose_thresholds,
    make_ranking_examples,
    train_ranking,
)
from training.progress import track_progress

# Narrower components are spikes at values such as 1; their density would measure rounding, not facades.
_MIN_DEVIATION = 0.03
# Share of the elements that Eq. 20 removes.
_REMOVED_SHARE = 0.1
# Passes over the database for the weights.
_PASSES = 3
# Step of the first pass.
_LEARNING_RATE = 0.08
# Floors whose step or height differs by more than this factor from the others are no progression.
_MAX_FLOOR_RATIO = 2.2
# Doors and shops that end higher above the ground line, in window heights, are signs and awnings.
_MAX_ENTRANCE_GAP = 0.5
# Facades of the database for which policies are optimised.
_POLICY_FACADES = 30


def learn_layout_model(
    layouts: Sequence[Layout],
    *,
    names: Sequence[str],
    metric: Sequence[Layout] = (),
    seed: int = 0,
) -> LayoutModel:
    """Learn densities, policies, weights and ranking trees from whole layouts.

    Parameters
    ----------
    layouts : (elements, domain) pairs.
    names : names of the layouts, stored with the model.
    metric : layouts in metres, for walls without any observation.

    Raises
    ------
    LayoutError
        For fewer than ten layouts with at least four elements.
    """
    from dataclasses import replace

    layouts = [([e for e in elements if e.label in ELEMENT_CLASSES], domain) for elements, domain in layouts]
    used = [(elements, domain) for elements, domain in layouts if len(elements) >= 4]
    if len(used) < 10:
        raise LayoutError(f"{len(used)} layouts with elements: too few to learn from; give at least ten")
    begin_stage("densities", 1)
    model = LayoutModel(
        fit_densities([measure_layout_from_elements(elements, domain) for elements, domain in used], seed),
        np.full(len(TERMS), len(TERMS) ** -0.5),
        True,
        sample_policies(POLICY_POPULATION, np.random.default_rng(seed)),
        np.bincount([ELEMENT_CLASSES.index(e.label) for es, _ in used for e in es], minlength=LABEL_COUNT)
        / sum(len(es) for es, _ in used),
        ElementPriors(
            _typical_sizes(used, "door", 3, seed),
            _typical_sizes(used, "shop", 6, seed),
            _typical_progressions(used, 8, seed),
            _size_to_spacing_quantiles(used),
        ),
        np.array(
            [s for s in (layout_style_vector(es, fit_columns_and_floors(es, d), d) for es, d in used) if s is not None]
        ),
        median_metric_pitches(metric),
        BoostedTrees(
            *(np.zeros(0, np.int64),) * 2, np.zeros(0, np.float32), *(np.zeros(0, np.int64),) * 2, np.zeros(0), 0.0
        ),
        np.ones(LABEL_COUNT),
        tuple(names),
    )
    report_progress("densities", 1)
    model = replace(model, policies=learn_policies(model, used, seed))
    model = replace(model, weights=learn_weights(model, used, seed))
    shown = make_ranking_examples(model, used, seed)
    begin_stage("trees", 3)
    model = replace(model, trees=train_ranking(shown, seed=seed))
    report_progress("trees", 1)
    return replace(model, min_probability=choose_thresholds(shown, seed=seed))


def fit_densities(
    statistics: Sequence[tuple[Float64Array, Float64Array, Float64Array]], seed: int
) -> ScoreTermDensities:
    """Fit the densities of the ten terms to the statistics of whole layouts.

    Parameters
    ----------
    statistics : one (unary, pairs, overall) triple of `measure_layout` for each layout.

    References
    ----------
    Fan et al. 2014, sections 4.1-4.3.
    """
    unary, pairs = (np.concatenate([s[k] for s in statistics]) for k in (0, 1))
    overall = np.stack([s[2] for s in statistics])
    mixtures = np.zeros((MIXTURE_COUNT, COMPONENT_COUNT, 5))
    for label in range(LABEL_COUNT):
        mixtures[label] = fit_mixture(unary[unary[:, st.LABEL] == label, st.ASPECT], seed)
    for row, values in (
        (WIDTH_RATIO_ROW, unary[:, st.WIDTH_RATIO]),
        (HEIGHT_RATIO_ROW, unary[:, st.HEIGHT_RATIO]),
        (REGULAR_X_ROW, unary[:, st.REGULAR_X]),
        (REGULAR_Y_ROW, unary[:, st.REGULAR_Y]),
        (COMPLETENESS_ROW, unary[:, st.COMPLETE]),
        (ALIGN_X_ROW, pairs[:, [st.ALIGN_X, st.GAP_X]]),
        (ALIGN_Y_ROW, pairs[:, [st.ALIGN_Y, st.GAP_Y]]),
        (COVERAGE_ROW, overall[:, st.COVERAGE]),
        (SIDE_BORDER_ROW, overall[:, [st.BORDER_LEFT, st.BORDER_RIGHT]].ravel()),
        (TOP_BORDER_ROW, overall[:, st.BORDER_TOP]),
        (BOTTOM_BORDER_ROW, overall[:, st.BORDER_BOTTOM]),
    ):
        unknown = np.isnan(values) if values.ndim == 1 else np.isnan(values).any(axis=1)
        mixtures[row] = fit_mixture(values[~unknown], seed)
    pattern = pairs[~np.isnan(pairs[:, st.PATTERN]), st.PATTERN].astype(int)
    counts = np.bincount(pattern, minlength=len(PATTERNS)) + 1.0
    return ScoreTermDensities(
        mixtures,
        np.maximum(MIN_LOG_DENSITY, np.log(counts / counts.sum())),
        _symmetry_table(overall),
        _compatibility_table(overall[:, st.TYPES].astype(int)),
    )


def fit_mixture(values: Float64Array, seed: int) -> Float64Array:
    """Fit a Gaussian mixture with diagonal covariances; BIC chooses the number of components.

    Parameters
    ----------
    values : (N,) values, or (N, 2) values with their condition.

    Returns
    -------
    (COMPONENT_COUNT, 5) components by ascending mean.
    """
    from sklearn.mixture import GaussianMixture

    data = values[:, None] if values.ndim == 1 else values
    out = np.zeros((COMPONENT_COUNT, 5))
    if len(data) < 2:
        centre = data.mean(axis=0) if len(data) else np.zeros(data.shape[1])
        out[0, :3] = 1, centre[0], 1
        out[0, 3:] = (centre[1], 1) if data.shape[1] > 1 else (0, 0)
        return out
    best, best_bic = None, np.inf
    for k in range(1, min(COMPONENT_COUNT, len(np.unique(data, axis=0))) + 1):
        fitted = GaussianMixture(
            k, covariance_type="diag", reg_covar=_MIN_DEVIATION**2, random_state=seed, n_init=2
        ).fit(data)
        bic = fitted.bic(data)
        if best is None or bic < best_bic:
            best, best_bic = fitted, bic
    assert best is not None
    order = np.argsort(best.means_[:, 0])
    for j, c in enumerate(order):
        out[j, 0] = best.weights_[c]
        out[j, 1], out[j, 2] = best.means_[c, 0], np.sqrt(best.covariances_[c, 0])
        if data.shape[1] > 1:
            out[j, 3], out[j, 4] = best.means_[c, 1], np.sqrt(best.covariances_[c, 1])
    return out


def _symmetry_table(overall: Float64Array) -> Float64Array:
    """Return ln p(symmetric share | door position), Eq. 11, from a smoothed histogram; row 0 is "no door"."""
    from scipy.ndimage import gaussian_filter, gaussian_filter1d

    histogram = np.zeros((DOOR_BINS, SYMMETRY_BINS))
    for share, at in overall[:, [st.SYMMETRY, st.DOOR_AT]]:
        histogram[door_bin(at), min(SYMMETRY_BINS - 1, int(share * SYMMETRY_BINS))] += 1
    histogram[0] = gaussian_filter1d(histogram[0], 1.0)
    histogram[1:] = gaussian_filter(histogram[1:], 1.0)
    histogram += 0.1
    log_density: Float64Array = np.maximum(MIN_LOG_DENSITY, np.log(histogram / histogram.sum(axis=1, keepdims=True)))
    return log_density


def _compatibility_table(types: Int64Array) -> Float64Array:
    """Tabulate Eq. 7-8: the fewest coherence sets, those of more than one facade, that cover each set of types.

    Entries are ln(1 - (number - 1) / types): the paper's number / types forbids a facade of one type and favours any
    facade with more types.
    """
    sets = [mask for mask, count in Counter(types.tolist()).items() if mask and count > 1]
    fewest = np.full(2**st.ELEMENT_TYPE_COUNT, st.ELEMENT_TYPE_COUNT + 1)
    fewest[0] = 0
    for wanted in range(1, 2**st.ELEMENT_TYPE_COUNT):  # the uncovered rest of a set is a smaller number
        left = [wanted & ~mask for mask in sets if wanted & mask]
        fewest[wanted] = min((fewest[rest] + 1 for rest in left), default=st.ELEMENT_TYPE_COUNT + 1)
    number = np.array([bin(wanted).count("1") for wanted in range(2**st.ELEMENT_TYPE_COUNT)])
    share = (fewest - 1).clip(0) / number.clip(1)
    return np.where(share < 1, np.log(np.maximum(1 - share, np.exp(MIN_LOG_DENSITY))), MIN_LOG_DENSITY)


def learn_policies(model: LayoutModel, layouts: Sequence[Layout], seed: int) -> Float64Array:
    """Optimise policies for some of the database's facades and keep the most different ones.

    Returns
    -------
    (POLICY_POPULATION, POLICY_LENGTH) policies.
    """
    rng = np.random.default_rng([seed, 1])
    chosen = rng.permutation(len(layouts))[:_POLICY_FACADES]
    found = []
    for count, k in enumerate(track_progress("policies", chosen.tolist(), len(chosen))):
        elements, domain = layouts[k]
        seen, region = training_cases.hide_part(
            training_cases.CASE_KINDS[count % len(training_cases.CASE_KINDS)], elements, domain, rng
        )
        if seen:
            start = observed_layout_arrays(
                seen, domain, box_array([]) if not region else np.array(region, float), model
            )
            first = sample_policies(POLICY_POPULATION, rng)
            used, _, scores = evolve_policy_candidates(first, start, model, 4, 2, seed)
            found.append(used[scores.argmax()])
    policies = np.array(found)
    kept = [0]
    while len(kept) < POLICY_POPULATION:  # add the policy farthest from those kept
        away = np.abs(policies[:, None] - policies[kept]).sum(axis=2).min(axis=1)
        kept.append(int(away.argmax()))
    return policies[kept].reshape(POLICY_POPULATION, POLICY_LENGTH)


def learn_weights(model: LayoutModel, layouts: Sequence[Layout], seed: int) -> Float64Array:
    """Learn the weights of the ten terms by contrastive divergence.

    Whole layouts are compared with completions of them after 10 % of their elements were removed. Weights stay
    positive, since every term favours a layout, and of unit length, since only their ratio ranks layouts.

    Returns
    -------
    (10,) weights in the order of TERMS.

    References
    ----------
    Fan et al. 2014, Eq. 17-20.
    """
    from dataclasses import replace

    rng = np.random.default_rng([seed, 2])
    positive = np.array([layout_score_terms(elements, domain, model) for elements, domain in layouts])
    scale = positive.std(axis=0) + 1e-3
    weights = model.weights
    begin_stage("weights", _PASSES * len(layouts))
    for turn in range(_PASSES):
        current = replace(model, weights=weights)
        gradient = np.zeros(len(TERMS))
        for k, (elements, domain) in enumerate(layouts):
            report_progress("weights", 1)
            keep = rng.uniform(size=len(elements)) >= _REMOVED_SHARE
            seen = [e for e, kept in zip(elements, keep, strict=True) if kept]
            if not seen:
                continue
            start = observed_layout_arrays(seen, domain, box_array([]), model)
            used, seeds, scores = evolve_policy_candidates(model.policies, start, current, 1, 1, seed + turn)
            best = int(scores.argmax())
            box, label, _ = roll_out_policy(used[best], start, int(seeds[best]))
            completed = [
                Element(ELEMENT_CLASSES[n], *corners) for n, corners in zip(label.tolist(), box.tolist(), strict=True)
            ]
            gradient += (positive[k] - layout_score_terms(completed, domain, current)) / scale
        weights = np.maximum(weights + _LEARNING_RATE * gradient / len(layouts) / np.sqrt(turn + 1), 0.02)
        weights = weights / np.linalg.norm(weights)
    return weights


def layout_style_vector(
    elements: Sequence[Element], facade: ColumnsAndFloors, domain: Rectangle
) -> Float64Array | None:
    """Return the style vector of a whole layout, None where its windows form no columns or floors.

    Parameters
    ----------
    elements : all elements of the layout.
    facade : frame of those elements.
    domain : (x0, y0, x1, y1) of the facade, y down.

    Returns
    -------
    (11,) ratios in the order of the column constants of `layout_sampling`.
    """
    if len(facade.columns) < 2 or len(facade.floors) < 2:
        return None
    pitch = np.array([np.median(np.diff(facade.columns)), np.median(np.diff(facade.floors))])
    labels = [e.label for e in elements]
    width, height = domain[2] - domain[0], domain[3] - domain[1]
    return np.array(
        [
            width / height,
            max(2, round((facade.columns[-1] - facade.columns[0]) / pitch[0]) + 1),
            max(2, round((facade.floors[-1] - facade.floors[0]) / pitch[1]) + 1),
            min(0.9, facade.size[0] / pitch[0]),
            min(0.9, facade.size[1] / pitch[1]),
            (facade.columns[0] - domain[0]) / pitch[0],
            (facade.floors[0] - domain[1]) / pitch[1],
            (domain[3] - facade.floors[-1]) / pitch[1],
            labels.count("door"),
            labels.count("shop"),
            labels.count("balcony") / labels.count("window"),
        ]
    )


def median_metric_pitches(layouts: Sequence[Layout]) -> dict[str, float]:
    """Return the median floor and column pitch of a database, metres."""
    pitches: list[list[float]] = [[], []]
    for elements, domain in layouts:
        facade = fit_columns_and_floors([e for e in elements if e.label == "window"], domain)
        for axis, centres in enumerate((facade.columns, facade.floors)):
            pitches[axis] += np.diff(centres).tolist()
    names = ("column pitch", "floor pitch")
    likely = [[p for p in found if low < p < high] for found, low, high in zip(pitches, (1, 2), (6, 5), strict=True)]
    return {
        name: round(float(np.median(found)), 2) if found else default
        for name, found, default in zip(names, likely, (2.6, 3.1), strict=True)
    }


def _typical_sizes(layouts: Sequence[Layout], label: str, count: int, seed: int) -> Float64Array:
    """Return (count, 3) cluster centres of width, height and gap below, in window sizes, of doors or shops."""
    from sklearn.cluster import KMeans

    found = []
    for elements, domain in layouts:
        facade = fit_columns_and_floors(elements, domain)
        for e in elements:
            gap = max(0.02, (facade.ground - e.y1) / facade.size[1])
            if e.label == label and gap < _MAX_ENTRANCE_GAP:
                found.append((e.width / facade.size[0], e.height / facade.size[1], gap))
    if len(found) < count:
        return np.array([[1.4, 1.5, 0.05]])
    values = np.log(np.array(found))
    sizes: Float64Array = np.exp(
        KMeans(min(count, len(values)), n_init=3, random_state=seed).fit(values).cluster_centers_
    )
    return sizes


def _typical_progressions(layouts: Sequence[Layout], count: int, seed: int) -> Float64Array:
    """Return at most (count, 4) cluster centres of downward floor progressions, as in `extrapolate_floors`."""
    from sklearn.cluster import KMeans

    found = []
    for elements, domain in layouts:
        facade = fit_columns_and_floors([e for e in elements if e.label == "window"], domain)
        found += log_floor_progressions(facade.floors, facade.floor_size[:, 1])
    values = np.array(found).reshape(-1, 4)
    values = values[(np.abs(values) < np.log(_MAX_FLOOR_RATIO)).all(axis=1)]
    count = min(count, len(np.unique(values.round(6), axis=0)))
    if not count:
        return np.ones((1, 4))
    progressions: Float64Array = np.exp(KMeans(count, n_init=3, random_state=seed).fit(values).cluster_centers_)
    return progressions


def log_floor_progressions(floors: Float64Array, heights: Float64Array) -> list[tuple[float, ...]]:
    """Return the log ratios of pitches and heights below each floor from the third on.

    Parameters
    ----------
    floors : (F,) floor centres, top to bottom.
    heights : (F,) window heights.

    Returns
    -------
    One tuple of four for each floor, in the order of `extrapolate_floors`.
    """
    found = []
    for k in range(2, len(floors)):
        pitch, height = np.median(np.diff(floors[:k])), np.median(heights[:k])
        steps, tall = np.diff(floors[k - 1 :]) / pitch, heights[k:] / height
        later = np.median(steps[1:]) if len(steps) > 1 else steps[0]
        row = (steps[0], later, tall[0], np.median(tall[1:]) if len(tall) > 1 else tall[0])
        found.append(tuple(np.log(row).tolist()))
    return found


def _size_to_spacing_quantiles(layouts: Sequence[Layout]) -> Float64Array:
    """Return (16, 2) quantiles of window size to spacing, horizontal and vertical."""
    found: list[list[float]] = [[], []]
    for elements, domain in layouts:
        facade = fit_columns_and_floors(elements, domain)
        for axis, centres in enumerate((facade.columns, facade.floors)):
            found[axis] += (facade.size[axis] / np.diff(centres)).tolist()
    quantiles = np.linspace(0.05, 0.95, 16)
    return np.column_stack([np.quantile(f, quantiles) if f else np.full(16, 0.5) for f in found])
