"""Classes of the data sets of street scenes, in their order, and what each class is to a wall."""

from __future__ import annotations

from dataclasses import dataclass

# Names with + are in front of a wall, those with - are outside a facade: sky, road, pavement and other ground.
_CITYSCAPES = """
-road -sidewalk building wall +fence +pole +traffic_light +traffic_sign +vegetation -terrain -sky +person +rider +car
+truck +bus +train +motorcycle +bicycle
"""
_ADE20K = """
wall building -sky floor +tree ceiling -road bed windowpane -grass cabinet -sidewalk +person -earth door table
-mountain +plant curtain chair +car -water painting sofa shelf house -sea mirror rug -field armchair seat +fence desk
-rock wardrobe lamp bathtub railing cushion base box column signboard chest_of_drawers counter -sand sink skyscraper
fireplace refrigerator grandstand -path stairs -runway case pool_table pillow screen_door stairway -river bridge
bookcase blind coffee_table toilet flower book -hill +bench countertop stove +palm kitchen_island computer
swivel_chair +boat bar arcade_machine hovel +bus towel light +truck tower chandelier awning +streetlight booth
television_receiver airplane -dirt_track apparel +pole -land bannister escalator ottoman bottle buffet poster stage
+van ship fountain conveyer_belt canopy washer plaything swimming_pool stool barrel basket waterfall tent bag
+minibike cradle oven ball food step tank trade_name microwave +pot +animal +bicycle -lake dishwasher screen blanket
sculpture hood sconce vase +traffic_light tray +ashcan fan pier crt_screen plate monitor bulletin_board shower
radiator glass clock flag
"""
_MAPILLARY_1 = """
+bird +ground_animal -curb +fence +guard_rail +barrier wall -bike_lane -crosswalk_plain -curb_cut -parking
-pedestrian_area -rail_track -road -service_lane -sidewalk bridge building tunnel +person +bicyclist +motorcyclist
+other_rider -lane_marking_crosswalk -lane_marking_general -mountain -sand -sky -snow -terrain +vegetation -water
banner +bench +bike_rack billboard -catch_basin cctv_camera +fire_hydrant +junction_box +mailbox -manhole +phone_booth
-pothole +street_light +pole +traffic_sign_frame +utility_pole +traffic_light +traffic_sign_back +traffic_sign_front
+trash_can +bicycle +boat +bus +car +caravan +motorcycle +on_rails +other_vehicle +trailer +truck +wheeled_slow
+car_mount +ego_vehicle unlabeled
"""
_MAPILLARY_2 = """
+bird +ground_animal +ambiguous_barrier +concrete_block -curb +fence +guard_rail +barrier -road_median -road_side
-lane_separator +temporary_barrier wall -bike_lane -crosswalk_plain -curb_cut -driveway -parking -parking_aisle
-pedestrian_area -rail_track -road -road_shoulder -service_lane -sidewalk -traffic_island bridge building garage
tunnel +person +person_group +bicyclist +motorcyclist +other_rider -lane_marking_dashed_line
-lane_marking_straight_line -lane_marking_zigzag_line -lane_marking_ambiguous -lane_marking_arrow_left
-lane_marking_arrow_other -lane_marking_arrow_right -lane_marking_arrow_split_left_or_straight
-lane_marking_arrow_split_right_or_straight -lane_marking_arrow_straight -lane_marking_crosswalk
-lane_marking_give_way_row -lane_marking_give_way_single -lane_marking_hatched_chevron -lane_marking_hatched_diagonal
-lane_marking_other -lane_marking_stop_line -lane_marking_symbol_bicycle -lane_marking_symbol_other -lane_marking_text
-lane_marking_only_dashed_line -lane_marking_only_crosswalk -lane_marking_only_other -lane_marking_only_test -mountain
-sand -sky -snow -terrain +vegetation -water banner +bench +bike_rack -catch_basin cctv_camera +fire_hydrant
+junction_box +mailbox -manhole +parking_meter +phone_booth -pothole signage_advertisement signage_ambiguous
signage_back signage_information signage_other signage_store +street_light +pole +pole_group +traffic_sign_frame
+utility_pole +traffic_cone +traffic_light_general_single +traffic_light_pedestrians +traffic_light_general_upright
+traffic_light_general_horizontal +traffic_light_cyclists +traffic_light_other +traffic_sign_ambiguous
+traffic_sign_back +traffic_sign_direction_back +traffic_sign_direction_front +traffic_sign_front
+traffic_sign_parking +traffic_sign_temporary_back +traffic_sign_temporary_front +trash_can +bicycle +boat +bus +car
+caravan +motorcycle +on_rails +other_vehicle +trailer +truck +vehicle_group +wheeled_slow water_valve +car_mount
+dynamic +ego_vehicle -ground static unlabeled
"""


@dataclass(frozen=True, slots=True)
class SemanticClasses:
    """Indices of the classes of a data set.

    Attributes
    ----------
    occluders : classes in front of a wall.
    outside : classes outside a facade.
    """

    occluders: tuple[int, ...]
    outside: tuple[int, ...]


def _read_table(table: str, count: int | None = None) -> SemanticClasses:
    names = table.split()[:count]
    return SemanticClasses(
        *(tuple(index for index, name in enumerate(names) if name.startswith(mark)) for mark in "+-")
    )


# Data sets by the number of their classes; networks of Mapillary Vistas 1.2 have or lack the class `unlabeled`.
CLASSES_BY_COUNT = {
    19: _read_table(_CITYSCAPES),
    65: _read_table(_MAPILLARY_1, 65),
    66: _read_table(_MAPILLARY_1),
    124: _read_table(_MAPILLARY_2),
    150: _read_table(_ADE20K),
}
DATA_SETS = "Cityscapes (19), ADE20K (150) or Mapillary Vistas (65, 66 or 124)"
