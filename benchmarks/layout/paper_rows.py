"""Experiments of the layout paper repeated: scores left out (Fig. 17, 18), and weights by the number of facades (Fig. 16)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.layout.figures import run
from benchmarks.papers.completion import SHORT_SEARCH, policy_search
from catalogs.readers.layouts import LayoutRecord
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.facade.layout.densities import TERMS
from facade_core.facade.layout.model import LayoutModel
from facade_core.facade.layout.scores import measure_layout_from_elements
from training.layout.learning import fit_densities, learn_weights

# Numbers of training facades of `weights_by_size`, as in the paper's Fig. 16.
TRAINING_SIZES = (100, 90, 80, 70, 60, 50, 40, 30, 20, 10)


def ablation(records: Sequence[LayoutRecord], model: LayoutModel) -> dict[str, Any]:
    """Mean F1@0.5 of the policy search (SHORT_SEARCH) with all scores and with each left out: the paper's Fig. 17 and 18."""

    def search(with_model: LayoutModel) -> float:
        found: float = run(records, policy_search(with_model, SHORT_SEARCH))["all"]["mean f1@0.5"]
        return found

    found = {"all scores": search(model)}
    for k, term in enumerate(TERMS):
        found[f"without {term}"] = search(
            dataclasses.replace(model, weights=np.where(np.arange(len(TERMS)) == k, 0.0, model.weights))
        )
    other = dataclasses.replace(model, averages_terms=not model.averages_terms)
    found["sums" if model.averages_terms else "means"] = search(other)
    return found


def weights_by_size(layouts: Sequence[LayoutRecord], model: LayoutModel) -> dict[str, Any]:
    """Weights of the scores learnt from fewer and fewer facades (the paper's Fig. 16): means and deviations of three draws,
    and the mean deviation over the scores."""
    whole = [([e for e in r.elements if e.label in ELEMENT_CLASSES], r.domain) for r in layouts]
    found: dict[str, Any] = {}
    for size in TRAINING_SIZES:
        weights = []
        for draw in range(3):
            chosen = [whole[i] for i in np.random.default_rng([size, draw]).permutation(len(whole))[:size]]
            statistics = [measure_layout_from_elements(elements, domain) for elements, domain in chosen]
            start = dataclasses.replace(
                model, densities=fit_densities(statistics, draw), weights=np.full(len(TERMS), len(TERMS) ** -0.5)
            )
            weights.append(learn_weights(start, chosen, draw))
        deviation = np.std(weights, axis=0)
        found[str(size)] = {
            "mean": dict(zip(TERMS, np.mean(weights, axis=0).round(3).tolist(), strict=True)),
            "deviation": dict(zip(TERMS, deviation.round(3).tolist(), strict=True)),
            "mean deviation": round(float(deviation.mean()), 4),
        }
    return found
