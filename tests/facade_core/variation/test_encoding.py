import io
import json
import zipfile

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from facade_core.core.errors import ImageError, InputError, LayoutError
from facade_core.core.types import Element
from facade_core.facade.variation.encoding import encode
from facade_core.facade.variation.enlargement import enlarge_facade
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.photo_exchange import permute_photo_elements
from facade_core.facade.variation.sampling import assign_elements_by_type, permute_within_types
from facade_core.facade.variation.variations import find_variations

WIDTH, HEIGHT = 30, 44


def window(state, rng):
    patch = np.full((HEIGHT, WIDTH, 3), (230.0, 228, 220))
    patch[3:-3, 3:14] = patch[3:-3, 16:-3] = (45, 55, 70)
    if state == 1:
        patch[3:22, 3:-3] = (200, 190, 170)
    if state == 2:
        patch[:] = (60, 90, 70)
        patch[::4] = (90, 120, 100)
    if state == 3:
        patch[3:-3, 3:9] = patch[3:-3, -9:-3] = (225, 215, 200)
    patch[3:-3] += rng.normal(0, 8)
    return patch


def facade(seed=0, rows=5, columns=8, states=4):
    """A wall, half of it in shadow, with windows whose boxes are a pixel off: image, elements, planted states."""
    rng = np.random.default_rng(seed)
    image = np.full((rows * 80 + 20, columns * 56 + 20, 3), (190.0, 175, 150))
    planted = rng.integers(states, size=rows * columns)
    elements = []
    for i, state in enumerate(planted):
        x, y = i % columns * 56 + 22, i // columns * 80 + 25
        image[y : y + HEIGHT, x : x + WIDTH] = window(state, rng)
        dx, dy = rng.integers(-1, 2, 2).tolist()
        elements.append(Element("window", x + dx, y + dy, x + dx + WIDTH, y + dy + HEIGHT))
    image[:, : image.shape[1] // 2] *= 0.8
    image += rng.normal(0, 6, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8), elements, planted


def found_types(hierarchy, columns=8):
    (grid,) = hierarchy.levels[0].grids
    return grid.ravel()


def inside(elements, shape):
    mask = np.zeros(shape, bool)
    for e in elements:
        mask[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] = True
    return mask


def rms(a, b, mask):
    return np.sqrt(((a[mask].astype(float) - b[mask]) ** 2).mean())


@pytest.fixture(scope="module")
def coded():
    image, elements, planted = facade()
    return image, elements, planted, encode(image, elements)


@pytest.mark.parametrize("seed", range(4))
def test_planted_states_are_the_types(seed):
    image, elements, planted = facade(seed, states=2 + seed % 3)
    assert adjusted_rand_score(planted, found_types(encode(image, elements))) >= 0.9


def test_levels_run_from_the_photo_to_one_type(coded):
    *_, hierarchy = coded
    assert len(hierarchy.levels) >= 3
    assert len(np.unique(hierarchy.levels[-1].grids[0])) == 1
    for level in hierarchy.levels:
        assert level.counts.sum() == 40
        assert np.allclose(level.probabilities.sum(axis=1), 1)
    assert np.allclose(hierarchy.levels[0].probabilities, np.eye(len(hierarchy.representatives)))
    assert (hierarchy.levels[-1].probabilities.max(axis=0) == 1).sum() == 1


def test_level_zero_is_close_to_the_photo(coded):
    image, elements, _, hierarchy = coded
    mask = inside(elements, image.shape[:2])
    first, wall = hierarchy.reconstruct(0), hierarchy.wall
    assert first.shape == image.shape
    assert rms(image, first, mask) < 12
    assert rms(image, wall, mask) > 50
    assert rms(image, first, ~mask) < 9


def test_what_stands_before_a_relabelled_window_stays():
    image, elements, _ = facade()
    railings = [Element("balcony", e.x0 - 4, e.y1 - 14, e.x1 + 4, e.y1 + 4) for e in elements[8:16]]
    for e in railings:
        image[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] = (20, 20, 20)
    hierarchy = encode(image, elements + railings)
    last = hierarchy.reconstruct(len(hierarchy.levels) - 1)
    rails = inside([Element("", e.x0 + 2, e.y0 + 2, e.x1 - 2, e.y1 - 2) for e in railings], image.shape[:2])
    assert rms(last, image, rails) < 12
    others = inside([Element("", e.x0 + 4, e.y0 + 4, e.x1 - 4, e.y1 - 4) for e in elements[16:]], image.shape[:2])
    assert (last[others].max(axis=1) < 30).mean() < 0.02, "no other window shows a railing"


def test_the_last_level_shows_one_window_everywhere(coded):
    image, elements, _, hierarchy = coded
    last = hierarchy.reconstruct(len(hierarchy.levels) - 1)
    cuts = [last[int(e.y0) + 4 : int(e.y1) - 4, int(e.x0) + 4 : int(e.x1) - 4].astype(float) for e in elements]
    right = np.stack([c for c, e in zip(cuts, elements, strict=True) if e.x0 > image.shape[1] / 2])
    # The same picture, up to the pixel by which boxes are off and the light of its place.
    assert np.median(np.abs(right - np.median(right, axis=0))) < 12


def test_samples_differ_repeat_by_seed_and_keep_the_wall(coded):
    image, elements, _, hierarchy = coded
    level = len(hierarchy.levels) // 2
    samples = [hierarchy.sample(level, seed) for seed in range(20)]
    assert len({s.tobytes() for s in samples}) == 20
    assert np.array_equal(samples[3], hierarchy.sample(level, 3))
    far = ~inside([Element("", e.x0 - 5, e.y0 - 5, e.x1 + 5, e.y1 + 5) for e in elements], image.shape[:2])
    assert np.array_equal(samples[0][far], hierarchy.photo[far])


def test_seeds_give_all_variations_before_any_twice():
    types = np.array([0, 0, 0, 1, 2, 2, 2])
    found = [tuple(permute_within_types(types, seed)) for seed in range(36)]
    assert len(set(found)) == 36
    assert all((types[list(shown)] == types).all() for shown in found)
    assert permute_within_types(np.array([0, 1, 2]), 5).tolist() == [0, 1, 2]


@pytest.mark.parametrize(("floors", "columns"), [(8, 8), (5, 13), (9, 12)])
def test_a_larger_facade_repeats_floors_and_bays(coded, floors, columns):
    image, _, _, hierarchy = coded
    larger = hierarchy.sample(1, 4, floors=floors, columns=columns)
    assert larger.shape == (image.shape[0] + (floors - 5) * 80, image.shape[1] + (columns - 8) * 56, 3)
    assert np.array_equal(larger, hierarchy.sample(1, 4, floors=floors, columns=columns))
    assert not np.array_equal(larger, hierarchy.sample(1, 5, floors=floors, columns=columns))
    found = enlarge_facade(hierarchy.wall, hierarchy.groups, hierarchy.cells, floors, columns, np.random.default_rng(4))
    assert len(found.places) == floors * columns
    middles = (found.boxes[:, :2] + found.boxes[:, 2:]) / 2
    assert np.ptp(middles[:, 0]) == pytest.approx((columns - 1) * 56, abs=4)
    assert np.ptp(middles[:, 1]) == pytest.approx((floors - 1) * 80, abs=4)


def test_neighbours_on_a_larger_facade_show_different_elements(coded):
    *_, hierarchy = coded
    rng = np.random.default_rng(1)
    larger = enlarge_facade(hierarchy.wall, hierarchy.groups, hierarchy.cells, 10, 16, rng)
    types = hierarchy.types_at(len(hierarchy.levels) - 1)
    shown = assign_elements_by_type(types, larger.places, larger.boxes, rng)
    _, counts = np.unique(shown, return_counts=True)
    assert len(counts) == 40
    assert np.ptp(counts) <= 2
    middles = (larger.boxes[:, :2] + larger.boxes[:, 2:]) / 2
    apart = np.hypot(*(middles[:, None] - middles).transpose(2, 0, 1))
    same = (shown[:, None] == shown) & (apart > 0)
    assert (same & (apart < 100)).sum() / 2 <= 0.05 * len(shown)


def test_a_facade_is_not_made_smaller_nor_enlarged_without_windows(coded):
    image, *_, hierarchy = coded
    with pytest.raises(LayoutError, match="floors=3: this facade has 5"):
        hierarchy.sample(0, 0, floors=3)
    with pytest.raises(LayoutError, match="no window"):
        encode(image, []).sample(0, 0, columns=3)


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 4), (2, 1), (2, 2)])
def test_a_facade_of_few_rows_and_bays_grows_as_well(rows, columns):
    image, elements, _ = facade(rows=rows, columns=columns)
    hierarchy = encode(image, elements)
    last = len(hierarchy.levels) - 1
    taller = hierarchy.sample(last, 0, floors=rows + 2)
    wider = hierarchy.sample(last, 0, columns=columns + 3)
    assert taller.shape[0] >= image.shape[0] + 2 * 60
    assert taller.shape[1] == image.shape[1]
    assert wider.shape[1] >= image.shape[1] + 3 * 45
    assert wider.shape[0] == image.shape[0]
    assert hierarchy.sample(last, 0, floors=rows, columns=columns).shape == image.shape


@pytest.mark.parametrize("seed", [-1, 0.5])
def test_samples_are_numbered_from_zero(coded, seed):
    image, elements, _, hierarchy = coded
    for sample in (
        lambda: hierarchy.sample(0, seed),
        lambda: hierarchy.sample(0, seed, floors=9),
        lambda: permute_photo_elements(image, find_variations(image, elements), 0, seed),
    ):
        with pytest.raises(InputError, match="numbered from 0"):
            sample()


def test_exchanged_in_the_photo_the_wall_stays_and_windows_are_other_windows(coded):
    image, elements, *_ = coded
    of = find_variations(image, elements)
    made, _ = permute_photo_elements(image, of, 1, 7)
    near = inside([Element("", e.x0 - 6, e.y0 - 6, e.x1 + 6, e.y1 + 6) for e in elements], image.shape[:2])
    assert np.array_equal(made[~near], image[~near])
    assert rms(made, image, inside(elements, image.shape[:2])) > 20
    assert np.array_equal(made, permute_photo_elements(image, of, 1, 7)[0])


def test_samples_of_level_zero_keep_each_places_type(coded):
    image, elements, _, hierarchy = coded
    mask = inside(elements, image.shape[:2])
    first = hierarchy.reconstruct(0)
    last_level = len(hierarchy.levels) - 1
    assert rms(first, hierarchy.sample(0, 1), mask) < 0.7 * rms(first, hierarchy.sample(last_level, 1), mask)


def test_file_is_small_self_describing_and_comes_back_the_same(coded, tmp_path):
    image, _, _, hierarchy = coded
    hierarchy.save(tmp_path / "facade.variation")
    again = Hierarchy.load(tmp_path / "facade.variation")
    assert (tmp_path / "facade.variation").stat().st_size == hierarchy.nbytes < image.nbytes / 10
    for level in (0, len(hierarchy.levels) - 1):
        assert np.array_equal(again.reconstruct(level), hierarchy.reconstruct(level))
        assert np.array_equal(again.sample(level, 5), hierarchy.sample(level, 5))
    with zipfile.ZipFile(io.BytesIO(hierarchy.to_bytes())) as archive:
        header = json.loads(archive.read("header.json"))
    assert header["format"] == "streetloom variation 3"
    assert len(header["levels"]) == len(hierarchy.levels)


def test_same_input_same_bytes(coded):
    image, elements, _, hierarchy = coded
    assert encode(image, elements, seed=4).to_bytes() == hierarchy.to_bytes()


def test_two_classes_make_two_grids():
    image, elements, _ = facade()
    balconies = [Element("balcony", e.x0 - 4, e.y1 - 12, e.x1 + 4, e.y1 + 4) for e in elements[:16]]
    hierarchy = encode(image, elements + balconies)
    assert [g.shape for g in hierarchy.levels[0].grids] == [(5, 8), (2, 8)]
    assert {g.label for g in hierarchy.groups} == {"window", "balcony"}


def test_bare_wall_and_one_element():
    image, elements, _ = facade()
    bare = encode(image, [])
    assert len(bare.levels) == 1
    assert rms(bare.reconstruct(0), image, np.ones(image.shape[:2], bool)) < 12
    assert np.array_equal(bare.sample(0, 1), bare.reconstruct(0))
    one = encode(image, elements[:1])
    assert len(one.levels) == 1
    mask = inside(elements[:1], image.shape[:2])
    assert rms(one.reconstruct(0), image, mask) < 14
    assert rms(one.wall, image, mask) > 30


def test_elements_over_the_border_and_tiny_ones():
    image, elements, _ = facade()
    over = Element("window", -10, -5, 30, 40)
    corner = Element("door", image.shape[1] - 20, image.shape[0] - 30, image.shape[1] + 9, image.shape[0] + 9)
    hierarchy = encode(image, [over, corner, Element("shop", 50, 50, 51, 52), *elements[9:]])
    assert sum(len(g.boxes) for g in hierarchy.groups) == 2 + len(elements[9:])
    assert hierarchy.reconstruct(0).shape == image.shape
    assert encode(image, [Element("window", 0, 0, image.shape[1], image.shape[0])]).reconstruct(0).shape == image.shape


@pytest.mark.parametrize(
    ("image", "elements", "error", "message"),
    [
        (np.zeros((5, 5)), [], ImageError, "uint8"),
        (np.zeros((5, 5, 4), np.uint8), [], ImageError, "uint8"),
        (np.zeros((0, 5, 3), np.uint8), [], ImageError, "uint8"),
        (np.zeros((2, 20000, 3), np.uint8), [], ImageError, "downsample"),
        (np.zeros((9, 9, 3), np.uint8), [Element("window", 20, 1, 30, 8)], LayoutError, "outside"),
        (np.zeros((9, 9, 3), np.uint8), [Element("window", 2, 1, 2, 8)], LayoutError, "no area"),
        (np.zeros((9, 9, 3), np.uint8), [Element("gate", 2, 1, 4, 8)], LayoutError, "unknown label"),
    ],
)
def test_bad_input(image, elements, error, message):
    with pytest.raises(error, match=message):
        encode(image, elements)


def test_bad_files_and_levels(coded, tmp_path):
    *_, hierarchy = coded
    with pytest.raises(InputError, match="levels 0 to"):
        hierarchy.reconstruct(len(hierarchy.levels))
    with pytest.raises(InputError, match="levels 0 to"):
        hierarchy.sample(-1, 0)
    for content in (b"", b"no zip", hierarchy.to_bytes()[:-200], hierarchy.to_bytes()[300:]):
        with pytest.raises(InputError, match="encode the facade again"):
            Hierarchy.from_bytes(content)
    (tmp_path / "bad").write_bytes(b"no zip")
    with pytest.raises(InputError, match="bad: variation file"):
        Hierarchy.load(tmp_path / "bad")
    with pytest.raises(InputError, match="absent: cannot be read"):
        Hierarchy.load(tmp_path / "absent")


@pytest.mark.long
def test_a_photographed_facade_has_levels_and_a_small_file(data):
    from benchmarks.variation import run

    report = run(data / "facades" / "ecp", every=10, others=False)
    # 7 of these 9: the only two of the 83 facades with fewer than 5 levels are among them.
    assert report["share with 5 to 10 levels"] >= 0.75
    assert 5 <= report["median"]["levels"] <= 10
    assert report["energy falls"]
    assert report["median"]["ssim"] >= 0.9
    assert report["median"]["png of the photo over bytes"] >= 15


def test_states_of_painted_facades():
    """A floor for the median over the styles; single styles with balconies before their windows are lower. Each
    leaf of a window mirrors houses and sky of its own, which hides what hangs behind it."""
    from benchmarks.painter.facade import paint_facade
    from benchmarks.painter.styles import STYLES

    found = []
    for style in STYLES:
        painted = paint_facade((18.0, 16.0), floors=5, columns=6, style=style, metres_per_pixel=0.04, seed=0)
        hierarchy = encode(painted.image, painted.elements)
        boxes = np.concatenate([g.boxes for g in hierarchy.groups])
        types = np.concatenate([g.types for g in hierarchy.groups])
        labels = np.concatenate([[g.label] * len(g.boxes) for g in hierarchy.groups])
        nearest = [
            np.argmin(np.abs(boxes - (e.x0, e.y0, e.x1, e.y1)).sum(axis=1) + 1e6 * (labels != e.label))
            for e in painted.elements
        ]
        found.append(adjusted_rand_score(painted.element_states, types[nearest]))
    assert np.median(found) >= 0.45
