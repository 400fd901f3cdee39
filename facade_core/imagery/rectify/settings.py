"""Tuned numbers of the checks of a photo."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PhotoChecks:
    """What a photo must show to be used, with the network of 0.1.0.

    Attributes
    ----------
    night_weights, night_bias : log odds of the night by the logarithm of four brightnesses (0 to 255, plus 8): median and 90 %
        of the upper quarter, 99 % of all, median of the rest. Fitted to the set `tuned` of benchmarks/night_photos and 233
        rectified facades of the day.
    min_daylight_exposure : exposure value at ISO 100 below which a scene is lit by lamps: 8 to 9 a few minutes after sunset, 4
        to 5 in a lit street.
    max_rectified_night_sky : largest median brightness (0 to 255) of the sky at night above a rectified facade, and
    max_night_sky_ratio : largest ratio of it to that of the facade: in the shade of a clear day the sky is brighter.
    min_sky_share : share of a rectified picture from which what is above the facade counts as its sky.
    min_lit_brightness : brightness (0 to 255) that a tenth of a facade exceeds by day, also where most of it is in the shade.
    min_upright_evidence : share of a picture with sky and roof above, and doors and shops below, weighed by the distance from
        the middle, from which it is upright.
    turn_weights : log odds of a direction by `photo_state.measure_direction`. Fitted to 463 rectified facades of CMP, ECP and
        Art-Deco and 238 street photos, each in all four directions.
    min_turn_probability : probability of another direction from which a photo is turned: of 701 upright pictures none reaches
        it in cross-validation; of the turned ones 76 % of ECP, 70 % of Art-Deco and 27 % of CMP do.
    """

    night_weights: tuple[float, ...] = (-4.1, -7.2, 6.2, 2.4)
    night_bias: float = 11.3
    min_daylight_exposure: float = 6.5
    max_rectified_night_sky: float = 70.0
    max_night_sky_ratio: float = 0.75
    min_sky_share: float = 0.01
    min_lit_brightness: float = 90.0
    min_upright_evidence: float = 0.03
    turn_weights: tuple[float, ...] = (-0.35, 0.30, 0.34, 0.59, -24.4, -0.38, -9.0, -3.1, 5.6, 1.0)
    min_turn_probability: float = 0.97


PHOTO_CHECKS = PhotoChecks()
