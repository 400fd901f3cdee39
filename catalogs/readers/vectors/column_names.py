"""Names of columns in the vector files of many countries, by the OpenStreetMap tag that they state."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.height_units import LENGTH_TAGS, UNIT_SUFFIXES

_TAG_COLUMN_NAMES = {
    "height": "height building_height bldg_height hoehe höhe gebaeudehoehe gebäudehöhe measuredheight "
    "measured_height heightroof height_roof bld_height bldg_hgt bldgheight building_hgt avg_height avg_hgt approx_hgt "
    "max_height max_hgt hgt gesamthoehe korkeus korgus altura altezza vyska hojd höjd "
    "hauteur hoogte h_building h_bldg h_mean h_median h_avg h_max relhmax h "
    "height_relativemax "
    "altura_edificio bygningshoyde bygningshøjde bygningshøyde hoejde hojde højde høyde bina_yuksekligi yukseklik yükseklik "
    "magassag magasság wysokosc wysokość výška_budovy vyska_budovy výška inaltime înălțime высота высота_здания "
    "高度 建物高さ 高さ 높이 "
    "height_agl relative_height rel_height building_h bldg_h",
    "height:eaves": "h_eaves relh2 eaves_height eave_height height_eaves height_relativeroofbase",
    "building:levels": "building_levels levels storeys stories num_storeys storeysaboveground "
    "storeys_above_ground floors num_floors n_floors number_of_floors numberoffloors numberoffloorsaboveground floor_count "
    "numfloors num_stories no_stories geschosse anzahl_geschosse nb_etages bouwlagen kerrosluku piani pisos plantas etager "
    "kerroslkm nombre_d_etages nombre_etages nb_niveaux pavimentos num_pavimentos numplantas num_plantas numero_plantas "
    "num_pisos numero_pisos n_piani num_piani numero_piani kondygnacje liczbakondygnacji liczba_kondygnacji pocet_podlazi "
    "počet_podlaží podlazi antal_etager antall_etasjer etasjer antal_vaningar vaningar våningar korruselisus korrused "
    "anzahlgs aog anzahl_oberirdischer_geschosse i_kerrlkm "
    "kat_sayisi kat_adedi emeletek этажность этажей 层数 楼层 楼层数 階数 地上階数 층수",
    "name": "name names bezeichnung naam nom building_name street_name strassenname straatnaam str_name road_name fullname "
    "nombre nome navn namn nimi nazwa nev nazev název isim adi название 名称 street st_name streetname vejnavn gatenavn "
    "nom_voie_g nom_1_g nom_1_gauche nom_collaboratif_gauche nom_coll_g "
    "gatunamn katunimi tienimi nazwa_ulicy nazev_ulice nome_via nombre_via nom_voie nom_rue",
    "building": "building",
    "building:part": "building_part",
    "min_height": "min_height building_min_height",
    "building:min_level": "building_min_level min_level min_floor",
    "location": "location",
    "is_underground": "is_underground underground",
    "has_parts": "has_parts",
    "building_id": "building_id",
    "layer": "layer",
    "roof:shape": "roof_shape building_roof_shape roofshape roof_type rooftype dachform",
    "roof:height": "roof_height building_roof_height roofheight",
    "roof:levels": "roof_levels building_roof_levels",
    "roof:angle": "roof_angle",
    "roof:direction": "roof_direction roof_slope_direction",
    "roof:orientation": "roof_orientation",
    "roof:colour": "roof_colour roof_color building_roof_colour roofcolor",
    "roof:material": "roof_material building_roof_material",
    "building:colour": "building_colour building_color facade_color facade_colour building_facade_colour colour",
    "building:material": "building_material facade_material building_facade_material",
    "start_date": "start_date year_built construction_year yearbuilt cnstrct_yr oorspronkelijkbouwjaar "
    "bouwjaar baujahr year_of_construction",
    "highway": "highway fclass",
    "tunnel": "tunnel",
    "area": "area",
    "junction": "junction",
    "width": "width road_width street_width breite strassenbreite largeur breedte wegbreedte rijbaanbreedte "
    "ancho anchura larghezza largura bredde bredd leveys szerokosc szerokość sirka šířka genislik genişlik ширина 宽度 幅員 "
    "pavement_width streetwidth",
    "width:carriageway": "width_carriageway carriageway_width fahrbahnbreite",
    "maxheight": "maxheight maxheight_physical clearance vertical_clearance durchfahrtshoehe durchfahrtshöhe",
    "lanes": "lanes num_lanes number_of_lanes fahrstreifen anzahl_fahrstreifen nb_voies rijstroken",
    "lane_markings": "lane_markings",
    "oneway": "oneway one_way einbahn sens sens_de_circulation",
    "surface": "surface surface_type road_surface pavement_type belag oberflaeche revetement verharding "
    "bgt_fysiekvoorkomen",
    "sidewalk": "sidewalk sidewalks gehweg trottoir stoep",
    "sidewalk:width": "sidewalk_width gehwegbreite largeur_trottoir",
    "cycleway": "cycleway cycle_track bike_path radweg fietspad piste_cyclable",
    "parking": "parking on_street_parking parkstreifen parkeerstrook stationnement",
    "parking:lane": "parking_lane",
    "parking:orientation": "parking_orientation",
    **{
        f"{thing}:{side}{more}": f"{thing}_{side}{more}".replace(":", "_")
        for thing, mores in (
            ("sidewalk", ("", ":width")),
            ("cycleway", ("",)),
            ("parking", ("", ":orientation")),
            ("parking:lane", ("",)),
        )
        for side in ("left", "right", "both")
        for more in mores
    },
    "covered": "covered",
    "indoor": "indoor",
    "footway": "footway",
    "crossing": "crossing",
    "crossing:markings": "crossing_markings",
    "railway": "railway",
    "gauge": "gauge",
    "natural": "natural",
    "leisure": "leisure",
    "landuse": "landuse",
    "waterway": "waterway",
    "place": "place",
    "amenity": "amenity",
    "man_made": "man_made",
    "area:highway": "area_highway",
}
# Tag -> names of its column in order of preference: lower case, with underscores for punctuation.
TAG_COLUMNS: Mapping[str, tuple[str, ...]] = {
    tag: tuple(
        f"{name}{suffix}" for suffix in (UNIT_SUFFIXES if tag in LENGTH_TAGS else ("",)) for name in names.split()
    )
    for tag, names in _TAG_COLUMN_NAMES.items()
}
# Columns of 3DBAG and similar sets: heights of roof and ground above the datum.
ROOF_LEVEL_COLUMNS = (
    "b3_h_dak_70p",
    "b3_h_70p",
    "b3_h_dak_50p",
    "b3_h_50p",
    "h_dak_70p",
    "h_dak_50p",
    "roof_0_75",
    "roof_0_50",
)
GROUND_LEVEL_COLUMNS = ("b3_h_maaiveld", "h_maaiveld", "ground_0_50", "ground_0_30")
# Columns of the height of the ground, which stand next to a height.
_GROUND_NAMES = (
    "groundelev ground_elevation ground_elev gnd_elev ground_height ground_z base_elev base_elevation terrainheight "
    "terrain_height gelaendehoehe hoehegrund z_min_sol altitude_minimale_sol altitude_sol gelaendepunkt terrain_z z_terrain "
    "hoehe_gelaende bodenhoehe elev_ground height_absolutemin abshmin t_kote quota_terreno quota_suolo cota_terreno"
)
GROUND_COLUMNS = tuple(f"{name}{suffix}" for suffix in UNIT_SUFFIXES for name in _GROUND_NAMES.split())
# Prefixes of columns that programs write for a namespace, or for the object that held the values.
_COLUMN_PREFIX = re.compile(r"^(?:bldg|gml|con|core|gen|att|attr|attributes?|properties|props|tags?|osm)_")
# Beginnings of 10 letters that several columns share: altitude_minimale_sol and altitude_maximale_toit.
_AMBIGUOUS_BEGINNINGS = frozenset(("altitude_m",))
# Columns of classes of streets and ground areas.
_CLASS_COLUMN_NAMES = (
    "class fclass subclass subtype type kind category road_class street_class street_type functional_class func_class mtfcc "
    "strassenklasse wegtype landuse land_use landcover land_cover natural leisure amenity nutzung nutzungsart bodengebruik "
    "functie bgt_functie bgt_fysiekvoorkomen plus_fysiekvoorkomen nature"
)
CLASS_COLUMNS = tuple(_CLASS_COLUMN_NAMES.split())
_ID_COLUMN_NAMES = (
    "id osm_id osmid osm_way_id full_id gml_id gmlid identificatie bag_id pand_id uuid building_id bldg_id gebaeude_id "
    "cleabs egid bin doitt_id objectid fid ogc_fid gid link_id road_id segment_id toid"
)
ID_COLUMNS = tuple(_ID_COLUMN_NAMES.split())
EXTRA_TAG_COLUMNS = ("other_tags", "tags")  # tags without a column of their own, as GDAL and pyrosm keep them
ELEMENT_TYPE_COLUMNS = ("element", "element_type", "osm_type")
_KNOWN_COLUMNS = frozenset(
    name
    for names in (
        *TAG_COLUMNS.values(),
        ROOF_LEVEL_COLUMNS,
        GROUND_LEVEL_COLUMNS,
        GROUND_COLUMNS,
        CLASS_COLUMNS,
        ID_COLUMNS,
        EXTRA_TAG_COLUMNS,
        ELEMENT_TYPE_COLUMNS,
    )
    for name in names
)

_JOINED_COLUMNS = {
    joined: name
    for name in sorted(_KNOWN_COLUMNS)
    if "_" in name and len(joined := name.replace("_", "")) >= VECTORS.min_joined_length
}


def match_known_columns(fields: Iterable[str], *, has_truncated_names: bool) -> dict[str, str]:
    """Return the field of each known column name.

    has_truncated_names: True where the file cuts names to 10 characters (.shp).
    """
    found: dict[str, str] = {}
    for field in fields:
        name = re.sub(r"[\s:.\-/()\[\]]+", "_", field.strip().lower()).lstrip("@_").rstrip("_")
        names = (
            [known for known in _KNOWN_COLUMNS if known[:10] == name and name not in _AMBIGUOUS_BEGINNINGS]
            if has_truncated_names and len(name) == 10
            else [name]
        )
        if not any(known in _KNOWN_COLUMNS for known in names):
            plain = _COLUMN_PREFIX.sub("", name)
            names = [plain if plain in _KNOWN_COLUMNS else _JOINED_COLUMNS.get(plain, plain)]
        for known in names:
            if known in _KNOWN_COLUMNS:
                found.setdefault(known, field)
    return found
