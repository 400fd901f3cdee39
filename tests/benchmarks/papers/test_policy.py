import numpy as np
import pytest

from benchmarks.papers.policy import roll_out_policy
from benchmarks.papers.policy_optimisation import (
    evolve_policy_candidates,
    observed_layout_arrays,
    sample_policies,
)
from facade_core.core.types import Element
from facade_core.facade.layout.model import POLICY_LENGTH, default_layout_model

DOMAIN = (0.0, 0.0, 200.0, 160.0)
REGION = np.array([[0.0, 0.0, 100.0, 160.0]])


def windows(xs, ys):
    return [Element("window", x - 8, y - 12, x + 8, y + 12) for y in ys for x in xs]


def start(seen, region=REGION):
    return observed_layout_arrays(seen, DOMAIN, region, default_layout_model())


def careful():
    """Neither random nor inventive: own label, copied spacing, fixed priorities, no mirror."""
    policy = np.zeros(POLICY_LENGTH)
    policy[3:8] = (1, 0, 2, 3, 4)  # right, left, up, down, fill
    policy[8], policy[11] = 1, 1
    return policy


@pytest.mark.long
def test_a_careful_policy_carries_a_grid_on():
    box, label, _ = roll_out_policy(careful(), start(windows((20, 60), (30, 70, 110))), 0)
    assert (label == 0).all()
    centres = {(round((b[0] + b[2]) / 2), round((b[1] + b[3]) / 2)) for b in box}
    assert {(20, 30), (60, 110)} <= centres  # x = 100 would reach into what is seen, so nothing follows beyond
    assert all(x <= 60 for x, _ in centres)
    box, _, _ = roll_out_policy(careful(), start(windows((20, 60), (30, 70, 110)), REGION - (0, 0, 10, 0)), 0)
    centres = {(round((b[0] + b[2]) / 2), round((b[1] + b[3]) / 2)) for b in box}
    assert {(x, y) for x in (100, 140, 180) for y in (30, 70, 110)} <= centres


def test_gaps_are_filled_inside_the_grid():
    seen = windows((20, 60, 100, 140, 180), (30, 110)) + windows((20, 180), (70,))
    box, _, _ = roll_out_policy(careful(), start(seen, np.zeros((0, 4))), 0)
    centres = {(round((b[0] + b[2]) / 2), round((b[1] + b[3]) / 2)) for b in box}
    assert {(60, 70), (100, 70), (140, 70)} <= centres


def test_observed_elements_are_hard_constraints_for_any_policy():
    seen = [*windows((20, 60), (30, 70, 110)), Element("door", 50, 130, 70, 160)]
    given = start(seen)
    for k, policy in enumerate(sample_policies(30, np.random.default_rng(0))):
        box, label, grid = roll_out_policy(policy, given, k)
        assert (box[: len(seen)] == given.box).all()
        assert set(np.unique(grid)) == set(range(grid.max() + 1))
        new = box[len(seen) :]
        assert (new >= 0).all()
        assert (new[:, 2] <= 200).all()
        assert (new[:, 3] <= 160).all()
        assert (new[:, 0] >= 100).all()
        for i, a in enumerate(box):
            for j in range(max(i + 1, len(seen)), len(box)):
                b = box[j]
                meets = min(a[2], b[2]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[1], b[1])
                assert not meets or {int(label[i]), int(label[j])} == {0, 1}


def test_search_is_deterministic_improves_and_can_be_replayed():
    model = default_layout_model()
    given = start(windows((20, 60), (30, 70, 110)))
    arguments = (model.policies, given, model, 6, 2)
    used, seeds, scores = evolve_policy_candidates(*arguments, 3)
    again = evolve_policy_candidates(*arguments, 3)
    assert (again[2] == scores).all()
    assert len(scores) == 6 * 10 * 2
    assert scores[20:].max() >= np.median(scores[:20])
    best = int(scores.argmax())
    assert len(roll_out_policy(used[best], given, int(seeds[best]))[0]) >= 6


def test_simplexes_hold():
    policies = sample_policies(50, np.random.default_rng(1))
    assert (policies[:, 9] + policies[:, 10] <= 1 + 1e-12).all()
    assert (policies[:, 11] + policies[:, 12] <= 1 + 1e-12).all()
    assert (np.sort(policies[:, 3:8], axis=1) == np.arange(5)).all()
