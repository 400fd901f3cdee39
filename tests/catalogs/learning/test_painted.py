import numpy as np

from catalogs.learning.painted import painted
from facade_core.labels import CLASSES
from facade_core.parse.network_views import ANY_CLASS


def test_painted_facades_tell_their_classes_and_what_is_in_front():
    facades = painted(4, seed=3)
    assert [facade.name for facade in facades] == ["3-0", "3-1", "3-2", "3-3"]
    for facade in facades:
        known = facade.labels < len(CLASSES)
        assert (facade.possible[known] == 1 << facade.labels[known]).all()
        assert (facade.possible[~known] == ANY_CLASS).all()
        assert set(np.unique(facade.occluder)) <= {0, 1}
    assert sum((facade.occluder == 1).any() for facade in facades) == 1
