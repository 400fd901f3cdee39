"""Numbers of the matching of photos."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MatchingSettings:
    """Numbers of the matching of photos with facades and of structure from motion.

    Attributes
    ----------
    max_features : features of a file; a block has thousands.
    progress_pictures : pictures between two lines of progress.
    progress_pairs : pairs between two lines of progress.
    min_model_pictures : Pictures that make a model.
    min_shared_features : features that two pictures must share.
    min_points : points of a model that the pose of a picture rests on: with half as many, parts of a street
        come together at another scale.
    min_track : Pictures that must show a point.
    max_gps_turn_deg : largest error of the heading of photos that GPS alone places.
    hand_height_m : Height of a camera in a hand above the ground, metres: GPS does not measure it.
    min_certain_probability : Minimum probability of a match that no person needs to confirm.
    max_candidates : candidates in the row of a photo.
    min_probability : probability of a candidate.
    max_side_px : largest side of a picture of a calibration.
    min_photos : Photos that structure from motion needs.
    max_reason_length : letters of a reason.
    """

    max_features: int = 4096
    progress_pictures: int = 8
    progress_pairs: int = 60
    min_model_pictures: int = 3
    min_shared_features: int = 30
    min_points: int = 60
    min_track: int = 3
    max_gps_turn_deg: float = 3.0
    hand_height_m: float = 1.6
    min_certain_probability: float = 0.8
    max_candidates: int = 3
    min_probability: float = 0.02
    max_side_px: int = 1000
    min_photos: int = 3
    max_reason_length: int = 200


MATCHING = MatchingSettings()
