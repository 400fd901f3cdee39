"""Tuned numbers of the textures of walls: hidden parts, floors, bays, entrances, and the synthesis of their pictures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BaySettings:
    """Bays of the walls of a building.

    Attributes
    ----------
    window_margin_m : wall on either side of a window, to the wall's edge or to a neighbour, metres.
    back_bay_factor : width of bays of backs, relative to those of fronts.
    bare_width_shares : candidate widths of bare wall, as shares of a bay.
    negligible_unevenness : variation of bare wall, in grey levels, that hardly counts as uneven.
    max_pier_m : largest width of wall between the windows of a street wall if one more bay fits, metres.
    min_section_bays : smallest width between seams, in bays, of a section with whole bays.
    seam_margin_m : distance of a window from a seam within its bay, metres.
    seam_margin_texels : the same in texels.
    min_width_share : smallest width of a window on a narrow wall or next to a seam, as a share of its width; a narrower one
        is omitted.
    min_wall_share : smallest share of wall of a ground floor that continues over a narrow wall.
    min_corner_wall_share : the same for a corner without a shop.
    """

    window_margin_m: float = 0.25
    back_bay_factor: float = 1.3
    bare_width_shares: tuple[float, float, float, float, float] = (0.08, 0.12, 0.18, 0.27, 0.4)
    negligible_unevenness: float = 3.0
    max_pier_m: float = 2.6
    min_section_bays: float = 0.75
    seam_margin_m: float = 0.08
    seam_margin_texels: float = 3.0
    min_width_share: float = 0.5
    min_wall_share: float = 0.6
    min_corner_wall_share: float = 0.97


BAYS = BaySettings()


@dataclass(frozen=True, slots=True)
class FloorSettings:
    """Floors of a wall.

    Attributes
    ----------
    min_floor_m : smallest height of a partial floor at a wall's foot or top, metres; lower rests join the neighbouring
        floor.
    max_shown_storey_m : height of an exemplar's lowest storey, metres, beyond which it is not enlarged: the wall grows alone.
    eaves_tolerance_m : largest distance of a wall's top from the eaves, metres, at which it shows the exemplar's crown.
    level_top_m : largest distance from its top, metres, at which a wall begins to be free of neighbours along all its
        width.
    max_floor_stretch : largest stretch of a floor over the exemplar's; beyond it the rest is bare wall.
    max_window_stretch : largest stretch of its windows.
    coping_m, coping_light : height of the coping of a plain top and of a ledge, metres, and the light of the coping and of a
        shadow relative to the wall.
    ledge_light : light of a wall relative to its ledge.
    grain : deviation of the light of plaster, grey levels.
    max_ground_floor_m : greatest height of a ground floor, metres.
    max_window_share, max_window_loss : largest share of a floor that its windows take, unless they would lose more of their
        height than `max_window_loss`, a share of it.
    min_spandrel_share : smallest share of a floor above and below its windows.
    """

    min_floor_m: float = 2.3
    max_shown_storey_m: float = 3.1
    eaves_tolerance_m: float = 0.3
    level_top_m: float = 0.3
    max_floor_stretch: float = 1.25
    max_window_stretch: float = 1.1
    coping_m: float = 0.12
    coping_light: float = 0.6
    ledge_light: float = 0.92
    grain: float = 2.5
    max_ground_floor_m: float = 6.0
    max_window_share: float = 0.75
    max_window_loss: float = 0.1
    min_spandrel_share: float = 0.06


FLOORS = FloorSettings()


@dataclass(frozen=True, slots=True)
class EntranceSettings:
    """Plain doors.

    Attributes
    ----------
    door_size_m : width and height of a door with its frame, metres.
    max_leaf_m : largest width of a leaf; a wider door has two.
    min_door_m2, min_door_seen : smallest area of a door in a picture, square metres, and smallest share of its height that is
        stretched over its hidden foot.
    min_door_fill : smallest share of its rectangle that a door in a picture fills; another is an error of the parser.
    min_fanlight_m : smallest height of an opening over a door, metres, that remains a window.
    frame_m : width of its frame, metres.
    door_margin_m : wall on either side of it, metres.
    frame_gains, pane_light : brightness of frames relative to the leaf, and of panes in grey levels.
    glazed_probability, planked_probability : probabilities of a pane, and of planks instead of panels.
    plank_m, rail_m, groove_m : widths of a plank, of the rail around a panel, and of a groove, metres.
    """

    door_size_m: tuple[float, float] = (1.02, 2.12)
    max_leaf_m: float = 1.4
    min_door_m2: float = 0.8
    min_door_seen: float = 0.4
    min_door_fill: float = 0.6
    min_fanlight_m: float = 0.3
    frame_m: float = 0.07
    door_margin_m: float = 0.2
    frame_gains: tuple[float, float] = (0.72, 1.45)
    pane_light: float = 46.0
    glazed_probability: float = 0.35
    planked_probability: float = 0.4
    plank_m: float = 0.115
    rail_m: float = 0.13
    groove_m: float = 0.014


ENTRANCES = EntranceSettings()


@dataclass(frozen=True, slots=True)
class GroundFloorSettings:
    """Ground floor of a wall: its doors, and the sequence of its units.

    Attributes
    ----------
    min_element_share : share of a column of the ground floor that shows an element; a lower one is a sill, a sign or an
        error of the parser.
    min_pier_m, min_element_m : smallest width of a pier, below which the elements beside it are one, and of an element;
        metres.
    width_step_m : step of the widths that sequences of units are compared by, metres.
    stretch_cost : cost per squared log ratio of the wall's width to that of the units.
    end_unit_cost : cost of a unit at the exemplar's left or right end inside of a wall.
    no_door_cost : cost of a wall without a door, where the exemplar has one.
    repeat_cost : cost of a unit next to itself.
    squeezed_cost : cost of elements that are squeezed by more than `element_stretch`.
    pier_stretch : range of the stretch of piers before elements change.
    element_stretch : range of the stretch of elements; a wall that needs more is laid out by bays.
    max_entrance_offset_m : largest distance of a mapped entrance from a door or a shop, metres.
    free_tolerance_m : metres by which a ground floor may extend beyond the free part of its wall.
    max_gain, max_tint : largest factors by which another floor is lightened or darkened, and a colour of it beyond that.
    sill_m : height of the sill below windows, metres.
    min_balustrade_share : share of the width of a plain ground floor from which balconies are a balustrade, and left out.
    max_door_bay : width of the windows of the bay with its door, over that of others.
    """

    min_element_share: float = 0.12
    min_pier_m: float = 0.12
    min_element_m: float = 0.4
    width_step_m: float = 0.25
    stretch_cost: float = 6.0
    end_unit_cost: float = 0.3
    no_door_cost: float = 0.5
    repeat_cost: float = 0.3
    squeezed_cost: float = 10.0
    pier_stretch: tuple[float, float] = (0.5, 1.8)
    element_stretch: tuple[float, float] = (0.8, 1.25)
    max_entrance_offset_m: float = 2.5
    free_tolerance_m: float = 0.1
    max_gain: float = 1.8
    max_tint: float = 1.15
    sill_m: float = 0.15
    min_balustrade_share: float = 0.5
    max_door_bay: float = 1.5


GROUND_FLOOR = GroundFloorSettings()


@dataclass(frozen=True, slots=True)
class HiddenFootSettings:
    """Foot of a facade that something hides.

    Attributes
    ----------
    min_hidden_row_share : hidden share of each row of the foot.
    min_hidden_share : hidden share of all of the foot: where less is hidden, what is seen beside it is the better source.
    min_seen_column_share : smallest visible share of a column: columns with less are ignored when a hidden foot is
        detected.
    min_height_storeys : height of a hidden foot in storeys; a lower one is the foot of a storey, which is inpainted.
    max_height_share : largest height of the foot, as a share of the facade's.
    max_hidden_source_share : largest hidden share of a storey that is repeated.
    usual_heights, usual_windows : range of the height of a usual storey, and of its windows, over the median.
    balcony_step_share : balconies, as a share of a storey, that count as none.
    max_likeness_loss : correlation of the windows of a storey with those of the others, below the best one: one with an
        entrance is no source.
    step_tolerance_storeys : storeys go on in step if the foot begins above windows, with this tolerance in storeys.
    min_correlation : they also do if what is seen of the last one, or its windows, correlate so well with the repeated one.
    max_gain : largest factor, either way, that brings the repeated storey to the light of the one above the foot.
    min_wall_share : share of wall that both storeys need for that factor.
    min_last_storeys : smallest height, in storeys, of the last repeated one; a lower rest is bare wall below the one above
        it.
    seam_storeys : rim below the top of the foot, in storeys, that is inpainted between photo and repetition.
    min_ground_floor_share : share of a row that shops and doors take on a ground floor.
    wall_colour_reach_storeys : below the ground a column has the colour of the wall so far to either side.
    min_street_columns : share of the columns that show street below the wall, from which the ground is known.
    max_plinth_storeys : the foot begins at most this far below such rows, in storeys, or a storey stands between.
    """

    min_hidden_row_share: float = 0.6
    min_hidden_share: float = 0.8
    min_seen_column_share: float = 0.3
    min_height_storeys: float = 0.6
    max_height_share: float = 0.5
    max_hidden_source_share: float = 0.1
    usual_heights: tuple[float, float] = (0.85, 1.15)
    usual_windows: tuple[float, float] = (0.75, 1.33)
    balcony_step_share: float = 0.1
    max_likeness_loss: float = 0.1
    step_tolerance_storeys: float = 0.05
    min_correlation: float = 0.4
    max_gain: float = 1.25
    min_wall_share: float = 0.05
    min_last_storeys: float = 0.7
    seam_storeys: float = 0.05
    min_ground_floor_share: float = 0.1
    wall_colour_reach_storeys: float = 1.0
    min_street_columns: float = 0.3
    max_plinth_storeys: float = 0.5


HIDDEN_FOOT = HiddenFootSettings()


@dataclass(frozen=True, slots=True)
class InpaintingSettings:
    """Inpainting of what is hidden of a facade, from layout and translations.

    Attributes
    ----------
    wall_margin : width of the wall that a layout implies around an element, as a share of its size.
    min_ground_confidence : smallest confidence of labels of the ground floor to be drawn: the visible ground floor is a
        better guide than a guess.
    min_agreement : smallest share of agreeing votes of other bays.
    max_working_px : most pixels of the working image of the inpainting of floors.
    seam_price : price of a seam for each unit of colour difference (0-1, three channels).
    max_reduction : most pixels of the image, along a side, in a working pixel.
    context_divisor : the context reaches this part of the longer side.
    trust_scale : share of the median best price at which the weight of a source falls to 1/e.
    outlier_price : price of a source for each squared difference from the weighted mean.
    max_rounds : rounds of copying at most: pixels beyond the reach of all translations are filled from filled ones.
    max_translations : translations that are offered to the graph cuts at most.
    min_roof_share : share of roof and sky among the known labels of a row from which it is one of the roof.
    foot_share : height of the ground floor, as a share of the image.
    level_tolerance_px : rows by which a source beside a pixel may be higher or lower.
    min_gain : smallest price reduction, for each hidden pixel, of an offered translation.
    min_shift_px : shortest translation in pixels of the working image; shorter ones copy an element onto itself.
    min_overlap_share : share of the image that both ends of a translation show at least.
    axis_tolerance_px : pixels by which a vertical or horizontal translation may be oblique.
    max_oblique, max_axial : most oblique and most axial translations.
    expansion_sweeps : sweeps over all labels of the graph cuts.
    """

    wall_margin: float = 0.3
    min_ground_confidence: float = 0.3
    min_agreement: float = 0.7
    max_working_px: int = 110_000
    seam_price: float = 0.02
    max_reduction: int = 8
    context_divisor: int = 24
    trust_scale: float = 0.1
    outlier_price: float = 1.0
    max_rounds: int = 4
    max_translations: int = 28
    min_roof_share: float = 0.25
    foot_share: float = 0.2
    level_tolerance_px: int = 3
    min_gain: float = 1e-5
    min_shift_px: int = 6
    min_overlap_share: float = 0.04
    axis_tolerance_px: int = 3
    max_oblique: int = 10
    max_axial: int = 24
    expansion_sweeps: int = 2


INPAINTING = InpaintingSettings()


@dataclass(frozen=True, slots=True)
class BlendingSettings:
    """Blending of gradients at seams, and joining of holes.

    Attributes
    ----------
    half_weight_step : colour step (0-1) of a seam that counts half, so that misplaced edges do not bleed.
    self_weight : pull of every pixel towards its own colour.
    max_coarse_unknowns : most unknowns of the grid that is solved directly.
    sweeps : sweeps of over-relaxation on each finer grid.
    over_relaxation : factor of over-relaxation.
    join_radius_px : holes nearer than twice this are blended together.
    max_samples : known pixels for the fit of a part's translation.
    """

    half_weight_step: float = 0.10
    self_weight: float = 2e-4
    max_coarse_unknowns: int = 12_000
    sweeps: int = 40
    over_relaxation: float = 1.8
    join_radius_px: int = 8
    max_samples: int = 4000


BLENDING = BlendingSettings()


@dataclass(frozen=True, slots=True)
class SourceCostSettings:
    """Prices of sources of hidden pixels.

    Attributes
    ----------
    line_prior_px : weight of the prior in pixels of a line.
    window_prior : weight of the prior as a share of a window.
    line_blur_sigma : rows over which line colours are mixed.
    image_prior_px : pixels of the whole image that each line adds.
    class_price : price, in the image's variance, of a pixel of another class than planned.
    window_class_price : price, in the image's variance, of surroundings of other classes.
    """

    line_prior_px: float = 40.0
    window_prior: float = 0.05
    line_blur_sigma: float = 2.0
    image_prior_px: float = 4.0
    class_price: float = 0.25
    window_class_price: float = 0.25


SOURCE_COSTS = SourceCostSettings()


@dataclass(frozen=True, slots=True)
class WindowCompletionSettings:
    """Completion of hidden windows and balconies from visible ones.

    Attributes
    ----------
    max_side_difference, max_side_difference_px : largest difference of equal sides, as a share and in pixels.
    max_refinement_px : largest shift of a copy to fit, pixels.
    shift_penalty : penalty for each pixel of that shift, as a share of the remaining difference.
    aligned_share : largest distance of an element from its row or column, as a share of its side.
    other_row_factor : factor of the difference to an element of another row, which has another head and sill.
    frame_share : frame and sill around an element, as a share of its side.
    fade_px : pixels over which a copy fades at its edges.
    max_difference_ratio : largest difference of a source, relative to the typical difference between visible elements.
    inpainted_weight : weight of inpainted pixels against visible ones in a comparison.
    sample_step_px : step between compared pixels.
    """

    max_side_difference: float = 0.15
    max_side_difference_px: int = 3
    max_refinement_px: int = 3
    shift_penalty: float = 0.05
    aligned_share: float = 0.35
    other_row_factor: float = 1.5
    frame_share: float = 0.12
    fade_px: int = 3
    max_difference_ratio: float = 4.0
    inpainted_weight: float = 0.3
    sample_step_px: int = 2


COMPLETION = WindowCompletionSettings()


@dataclass(frozen=True, slots=True)
class RetargetingSettings:
    """Facades of another width and height from one picture.

    Attributes
    ----------
    generations : generations of the search.
    price_noise : log-normal deviation of jump prices between results.
    eaves_price : price of showing the top floor, which has the eaves, below another.
    pier_stretch : range of a pier's stretch before its windows change.
    window_stretch : range of a window's stretch beyond which its piers change alone.
    min_house_bays : fewest bays of a house among others in a front; each has one door.
    cut_reach_px : pixels on either side of a cut that are compared.
    jump_price : price of any jump, in mean absolute colour difference (0-1).
    repeat_price : price of showing a part twice in a row.
    min_cut_px : pixels of a cut through an element from which it counts; the parser may join elements by less.
    mismatch_price : price of a jump between different labels, such as from a balcony to plain wall.
    """

    generations: int = 400
    price_noise: float = 0.35
    eaves_price: float = 2.0
    pier_stretch: tuple[float, float] = (0.45, 1.8)
    window_stretch: tuple[float, float] = (0.9, 1.1)
    min_house_bays: int = 4
    cut_reach_px: int = 4
    jump_price: float = 0.03
    repeat_price: float = 0.02
    min_cut_px: int = 4
    mismatch_price: float = 0.6


RETARGETING = RetargetingSettings()


@dataclass(frozen=True, slots=True)
class SynthesisSettings:
    """Synthesis of facades from the tiles of one picture.

    Attributes
    ----------
    generations : generations of the search.
    max_seam_shift_px : largest distance of a path from the border, in pixels of the exemplar.
    band_sigma_px : deviation in pixels that separates colour (low band) from detail (high band).
    fade_px : width in pixels of the cross-fade of colour on either side of a border.
    strip_samples : samples along a boundary of tiles to which its strip is reduced.
    half_strip_px : width of half a strip in pixels of the exemplar.
    max_windows : most strips of the exemplar among which the nearest is searched.
    zeta_share : zeta of the energy, as a share of the span of distances.
    histogram_steps : steps to which label histograms are rounded.
    """

    generations: int = 5000
    max_seam_shift_px: int = 5
    band_sigma_px: float = 6.0
    fade_px: int = 10
    strip_samples: int = 8
    half_strip_px: int = 3
    max_windows: int = 768
    zeta_share: float = 0.1
    histogram_steps: int = 16


SYNTHESIS = SynthesisSettings()


@dataclass(frozen=True, slots=True)
class RoofRemovalSettings:
    """Roofs above the wall of a picture.

    Attributes
    ----------
    min_wall_share : smallest share of wall in a row of a frieze, parapet or cornice, which closes the wall.
    min_chroma_difference, min_darkening : differences from the wall below in CIELAB, of hue and of lightness, from which a
        row shows a roof or the sky. A lighter row may be a sunlit wall.
    min_foreign_share : smallest share of such rows above the lowest of them.
    min_foreign_storeys : smallest height of such rows, in storeys; lower ones may be a cornice or its shadow.
    """

    min_wall_share: float = 0.5
    min_chroma_difference: float = 14.0
    min_darkening: float = 20.0
    min_foreign_share: float = 0.8
    min_foreign_storeys: float = 0.15


ROOF_REMOVAL = RoofRemovalSettings()


@dataclass(frozen=True, slots=True)
class PictureSettings:
    """Size and scale of a usable picture of a facade.

    Attributes
    ----------
    door_height_m : height of a door in metres, frame included.
    window_share : share of a floor's height that its windows take.
    min_side_px : smallest side of a usable facade image in pixels.
    """

    door_height_m: float = 2.4
    window_share: float = 0.55
    min_side_px: int = 16


PICTURES = PictureSettings()


@dataclass(frozen=True, slots=True)
class TintSettings:
    """Variation of paint and panes between buildings.

    Attributes
    ----------
    shade_deviation, hue_deviation : deviations of the paint between buildings of one colour: logarithm of its light, and of
        each band.
    pane_deviation, pane_slope_deviation : deviations of the light of panes, in logarithms: of each window, and from its top
        to its foot.
    lamp_probability : share of windows with a lamp or a warm curtain.
    min_frame_light : grey level from which a pixel of a window is a frame.
    """

    shade_deviation: float = 0.035
    hue_deviation: float = 0.010
    pane_deviation: float = 0.05
    pane_slope_deviation: float = 0.08
    lamp_probability: float = 0.05
    min_frame_light: int = 205


TINT = TintSettings()
