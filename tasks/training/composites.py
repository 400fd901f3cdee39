"""Composite streets: synthetic blocks with photos of facades and ground, rendered with and without texture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from catalogs.learning.datasets import read_ecp_facades, split_facades_for_training
from facade_core.core.arrays import UInt8Array
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.streets import Viewpoint
from facade_core.street.translator.training_views import PANORAMA_WIDTHS, TrainingPair, render_sequence
from facade_core.synth.street_paint import ground_photo_painter, replace_front_images
from facade_core.synth.street_truth import (
    SyntheticStreet,
    render_street_panorama,
    synthetic_street,
)
from tasks.engine.progress import begin_stage, report_progress
from tasks.training.materials import read_picture_and_digest
from tasks.training.parser import split_cmp_photos

STREET_COUNT = 12
BUILDINGS_PER_STREET = 8
TEXELS_PER_METRE = 20.0
SPACING_M = 5.0
CAMERA_HEIGHT_M = 2.5
# Pictures in materials/ and their widths, metres.
ROADWAY = ("asphalt.jpg", 1.2)
PAVEMENTS = (("slabs.jpg", 1.0), ("concrete.jpg", 1.2))


def render_composites(data: Path, *, seed: int) -> list[TrainingPair]:
    """Render pairs of views along streets with photographed facades and ground.

    Facades come from facades/ecp and facades/cmp without their held-out folds, ground from materials/.

    Parameters
    ----------
    data : data folder.
    seed : random seed.

    Raises
    ------
    InputError : a data set is missing.
    """
    photos = [
        facade.image for facade in split_facades_for_training(list(read_ecp_facades(data / "facades" / "ecp")))[0]
    ]
    photos += [facade.image for facade in split_cmp_photos(data)[0]]
    roadway = (read_picture_and_digest(data / "materials" / ROADWAY[0])[0], ROADWAY[1])
    pavements = [(read_picture_and_digest(data / "materials" / name)[0], metres) for name, metres in PAVEMENTS]
    found: list[TrainingPair] = []
    begin_stage("composites", STREET_COUNT)
    for number in range(STREET_COUNT):
        rng = np.random.default_rng([seed, number])
        chosen = rng.choice(len(photos), BUILDINGS_PER_STREET, replace=len(photos) < BUILDINGS_PER_STREET)
        plain = synthetic_street(
            BUILDINGS_PER_STREET, seed=1000 * seed + number, occluders=0, texels_per_metre=TEXELS_PER_METRE
        )
        street = replace_front_images(plain, [photos[index] for index in chosen])
        found += _pairs(street, roadway, pavements[number % len(pavements)])
        report_progress("composites", 1)
    return found


def _pairs(
    street: SyntheticStreet, roadway: tuple[UInt8Array, float], pavement: tuple[UInt8Array, float]
) -> Iterator[TrainingPair]:
    scene, width = street.scene, max(PANORAMA_WIDTHS)
    viewpoints = []
    for number, along in enumerate(np.arange(SPACING_M / 2, street.length, SPACING_M)):
        x, y = street.world_point(float(along), 0.0)
        viewpoints.append(Viewpoint(number, 0, np.array([x, y, CAMERA_HEIGHT_M]), street.axis))
    ground = ground_photo_painter(street, roadway, pavement)
    heading = float(np.degrees(np.arctan2(street.axis[0], street.axis[1])))
    # side walls and roofs are grey in the ground truth: training ignores them
    true = np.append(scene.charts.kind == ChartKind.GROUND, False)
    true[list(street.charts)] = True
    for viewpoint, bare in zip(viewpoints, render_sequence(scene, viewpoints), strict=True):
        x, y, z = viewpoint.position.tolist()
        image = render_street_panorama(street, Pose(x, y, z, heading), width, seed=viewpoint.id, ground=ground)
        yield TrainingPair(bare, image, true[scene.cast_panorama(viewpoint, width)[2]])
