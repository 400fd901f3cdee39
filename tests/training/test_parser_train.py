import numpy as np
import pytest

from benchmarks.in_front import marked
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from training.datasets.facades import ANY_CLASS, LabelledFacade
from training.datasets.occluder_boxes import OccluderBoxes, read_occluder_boxes
from training.parser.occluder_labels import ground_floor_rows
from training.parser.sets import paint_labelled_facades, relabel_occluders


def facade(labels):
    image = np.full((*labels.shape, 3), 190, np.uint8)
    possible = np.where(labels == UNKNOWN, 127, 1 << np.minimum(labels, 6)).astype(np.uint8)
    return LabelledFacade("one", image, labels, possible, *np.zeros((2, *labels.shape), np.uint8))


@pytest.fixture
def plain():
    """200 rows: sky, wall, and from row 150 on a door and a shop."""
    labels = np.full((200, 120), FacadeClass.WALL, np.uint8)
    labels[:20] = FacadeClass.SKY
    labels[150:, 10:60], labels[160:, 70:90] = FacadeClass.SHOP, FacadeClass.DOOR
    return facade(labels)


def test_the_ground_floor_begins_at_its_shops_and_doors(plain):
    assert ground_floor_rows(plain.labels, plain.possible) == (150, 200)
    plain.labels[40:60, :30] = FacadeClass.SHOP  # far above: not of the ground floor
    assert ground_floor_rows(plain.labels, plain.possible) == (150, 200)
    assert ground_floor_rows(*[np.full((80, 40), FacadeClass.WALL, np.uint8)] * 2) == (60, 80)
    cut = np.full((80, 40), UNKNOWN, np.uint8)
    cut[10:50] = FacadeClass.WALL
    assert ground_floor_rows(cut, facade(cut).possible) == (40, 50)


def test_the_foot_is_not_told_where_nobody_looked(plain):
    plain.possible[30:50, 100:] = 127
    (told,) = relabel_occluders("ecp", [plain], {})
    assert (told.occluder[150:] == UNKNOWN).all()
    assert (told.occluder[30:50, 100:] == UNKNOWN).all()
    assert (told.occluder[:150, :90] == 0).all()
    assert told.labels is plain.labels
    (looked_at,) = relabel_occluders("ecp", [plain], {"ecp/one": OccluderBoxes([])})
    assert (looked_at.occluder[50:] == 0).all()
    (beside,) = relabel_occluders("ecp", [plain], {"ecp/one": OccluderBoxes([(10, 180, 30, 196)])})
    assert (beside.occluder[175:, 36:] == 0).all(), "clear where no box is near"
    assert (beside.occluder[196:, 10:30] == UNKNOWN).all()
    (doubtful,) = relabel_occluders("ecp", [plain], {"ecp/one": OccluderBoxes([], [(10, 180, 30, 196)])})
    assert (doubtful.occluder[178:, 8:32] == UNKNOWN).all()
    assert (doubtful.occluder != 1).all()
    assert (doubtful.occluder[175:, 36:] == 0).all()


def test_a_thing_in_a_box_is_in_front_and_around_it_nothing_is_told(plain):
    plain.image[172:196, 34:88] = (150, 20, 30)
    (told,) = relabel_occluders("ecp", [plain], {"ecp/one": OccluderBoxes([(30, 168, 92, 200)])})
    assert (told.occluder[176:192, 40:82] == 1).mean() > 0.95
    assert not (told.occluder == 1)[:168].any()
    assert (told.occluder[165:168, 30:92] == UNKNOWN).all()
    assert (told.occluder[150:160] == 0).all()
    (again,) = relabel_occluders("ecp", [plain], {"ecp/one": OccluderBoxes([(30, 168, 92, 200)])})
    assert (again.occluder == told.occluder).all()


def test_leaves_and_what_is_no_facade_are_not_told(plain):
    plain.image[60:80, 20:40] = (60, 110, 50)
    (told,) = relabel_occluders("cmp", [plain], {})
    assert (told.occluder[60:80, 20:40] == UNKNOWN).all()
    assert (told.occluder[100:140] == 0).all()
    (empty,) = relabel_occluders("cmp", [facade(np.full((9, 9), UNKNOWN, np.uint8))], {})
    assert (empty.occluder == UNKNOWN).all()


def test_the_boxes_are_of_photos_that_are_trained_on():
    looked = read_occluder_boxes()
    assert not {f"ecp/{name}" for name in marked()} & looked.keys()
    assert sum(name.startswith("ecp/") for name in looked) == 66
    assert all(x0 < x1 and y0 < y1 for boxes in looked.values() for x0, y0, x1, y1 in (*boxes.found, *boxes.doubtful))


@pytest.mark.long
def test_what_calibrates_is_neither_trained_on_nor_held_out(data):
    from training.datasets.facades import CMP, read_dataset, split_facades_for_training
    from training.parser.train import split_cmp_photos

    trained, apart = ({facade.name for facade in part} for part in split_cmp_photos(data))
    held_out = {
        facade.name for facade in split_facades_for_training(list(read_dataset(CMP, data / "facades" / "cmp")))[1]
    }
    assert len(trained | apart | held_out) == len(trained) + len(apart) + len(held_out) == 317
    assert len(apart) == 32


def test_painted_facades_tell_their_classes_and_what_is_in_front():
    facades = paint_labelled_facades(4, seed=3)
    assert [facade.name for facade in facades] == ["3-0", "3-1", "3-2", "3-3"]
    for facade in facades:
        known = facade.labels < len(CLASSES)
        assert (facade.possible[known] == 1 << facade.labels[known]).all()
        assert (facade.possible[~known] == ANY_CLASS).all()
        assert set(np.unique(facade.occluder)) <= {0, 1}
    assert sum((facade.occluder == 1).any() for facade in facades) == 1
