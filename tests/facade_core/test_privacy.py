import numpy as np

from facade_core.imagery.privacy import apply_privacy


def scene():
    """A white wall, 40 x 60 texels, and before it a thing with a pattern of single texels."""
    evidence = np.full((40, 60, 3), 250, np.uint8)
    hidden = np.zeros((40, 60), bool)
    hidden[12:38, 7:33] = True
    evidence[hidden] = np.random.default_rng(0).integers(0, 2, (hidden.sum(), 1), dtype=np.uint8) * 200
    return evidence, hidden


def test_what_is_blurred_has_one_colour_in_each_half_metre():
    evidence, hidden = scene()
    found = apply_privacy(evidence, hidden, "blur", 20.0)
    assert (found[~hidden] == evidence[~hidden]).all()
    for y in range(0, 40, 10):
        for x in range(0, 60, 10):
            cell = np.s_[y : y + 10, x : x + 10]
            colours = found[cell][hidden[cell]]
            if len(colours):
                assert (colours == np.rint(evidence[cell][hidden[cell]].mean(axis=0))).all()
    assert len(np.unique(found[hidden], axis=0)) > 3, "a thing can still be told"


def test_of_what_is_masked_nothing_is_left_and_what_is_kept_is_as_it_was():
    evidence, hidden = scene()
    masked = apply_privacy(evidence, hidden, "mask", 20.0)
    assert (masked[~hidden] == evidence[~hidden]).all()
    assert len(np.unique(masked[hidden], axis=0)) == 1
    assert apply_privacy(evidence, hidden, "keep", 20.0) is evidence
    assert apply_privacy(evidence, np.zeros_like(hidden), "blur", 20.0) is evidence
    assert (evidence == scene()[0]).all(), "the evidence itself is as it was"
