"""Columns of vector files as the equivalent OpenStreetMap tags."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from catalogs.readers.vectors.height_units import LENGTH_TAGS, METRES, UNIT_SUFFIXES, ColumnUnits
from catalogs.readers.vectors.lengths import is_unknown_code

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
_GROUND_RANGE_M = (-500.0, 9000.0)  # m; other numbers are codes for unknown
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
# Share of unique values above which a column is used as ids.
MIN_UNIQUE_SHARE = 0.6
_EXTRA_TAG_COLUMNS = ("other_tags", "tags")  # tags without a column of their own, as GDAL and pyrosm keep them
_ONE_WAY_CODES = ("F", "T")  # Geofabrik: along the line, against it; B for both
_MAX_CELL_LENGTH = 10_000  # letters of a cell that are read
_ELEMENT_TYPE_COLUMNS = ("element", "element_type", "osm_type")
_PAIR = re.compile(r'"((?:[^"\\]|\\.)*)"\s*=>\s*"((?:[^"\\]|\\.)*)"')
_OSM_ID = re.compile(r"(node|way|relation)/(\d+)")
# Floats of this size skip integers. GDAL writes such numbers in exponent form in text columns.
MIN_INEXACT_INTEGER = 2**53
_INEXACT_NUMBER = re.compile(r"\d\.\d{15,16}e\+\d+")
# Remarks on changed ids, after "buildings of b.gpkg".
_NUMBERED_REMARK = "numbered since another has their id"
_BY_ROW_REMARK = "named by their row, since too few have an id of their own"
_INEXACT_REMARK = "whose id is a number too large to be held whole; write it as text"

_KNOWN_COLUMNS = frozenset(
    name
    for names in (
        *TAG_COLUMNS.values(),
        ROOF_LEVEL_COLUMNS,
        GROUND_LEVEL_COLUMNS,
        GROUND_COLUMNS,
        CLASS_COLUMNS,
        ID_COLUMNS,
        _EXTRA_TAG_COLUMNS,
        _ELEMENT_TYPE_COLUMNS,
    )
    for name in names
)

# Known names whose words other maps join: BuildingHeight. Short ones are words of their own: hm, of h_m.
_MIN_JOINED_LENGTH = 6
_JOINED_COLUMNS = {
    joined: name
    for name in sorted(_KNOWN_COLUMNS)
    if "_" in name and len(joined := name.replace("_", "")) >= _MIN_JOINED_LENGTH
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


def tags_from_records(
    records: Iterable[Mapping[str, object]], columns: Mapping[str, str], units: ColumnUnits = METRES
) -> list[dict[str, str]]:
    """Return the stated tags of each record as text; lengths are in metres, or have a unit.

    `ground` is the height of the ground above the datum; `class` has the values of all class columns, one per line.

    Parameters
    ----------
    records : rows of a layer.
    columns : field by known column name.
    units : units of the columns.
    """
    present = {tag: [(name, columns[name]) for name in names if name in columns] for tag, names in TAG_COLUMNS.items()}
    more = [columns[name] for name in _EXTRA_TAG_COLUMNS if name in columns]
    classes = [columns[name] for name in CLASS_COLUMNS if name in columns]
    levels = [
        [columns[name] for name in names if name in columns] for names in (ROOF_LEVEL_COLUMNS, GROUND_LEVEL_COLUMNS)
    ]
    levels = levels if all(levels) else []
    grounds = [(name, columns[name]) for name in GROUND_COLUMNS if name in columns]
    result = []
    for record in records:
        tags: dict[str, str] = {}
        for field in more:
            tags |= _parse_tags(record[field])
        for tag, sources in present.items():
            for name, field in sources:
                if text := cell_text(record[field]):
                    tags[tag] = (
                        text
                        if tag == "height" and is_unknown_code(text)
                        else units.to_metres(text, name)
                        if tag in LENGTH_TAGS
                        else _primary_name(text)
                        if tag == "name"
                        else text
                    )
                    break
        if stated := [text for field in classes if (text := cell_text(record[field]))]:
            tags["class"] = "\n".join(stated)
        if "fclass" in columns and tags.get("oneway") in _ONE_WAY_CODES:
            tags["oneway"] = "yes"
        if (
            "height" not in tags
            and levels
            and (found := _height_above_ground(record, levels[0], levels[1], units.metres_per_unit("")))
        ):
            tags["height"], tags["ground"] = found
        if "ground" not in tags and (ground := _ground_height(record, grounds, units)):
            tags["ground"] = ground
        result.append(tags)
    return result


def assumed_units(tags: Sequence[Mapping[str, str]], columns: Mapping[str, str], units: ColumnUnits) -> list[str]:
    """Return the fields of lengths that state no unit and are taken in that of the frame.

    Parameters
    ----------
    tags : tags of each record.
    columns : field by known column name.
    units : units of the columns.
    """
    names = {tag: TAG_COLUMNS[tag] for tag in LENGTH_TAGS} | {"ground": GROUND_COLUMNS}
    stated = {tag: [name for name in known if name in columns] for tag, known in names.items()}
    return sorted(
        columns[known[0]]
        for tag, known in stated.items()
        if known and units.is_assumed(known[0]) and any(tag in one for one in tags)
    )


def _ground_height(record: Mapping[str, object], grounds: Iterable[tuple[str, str]], units: ColumnUnits) -> str | None:
    """Return the height of the ground in metres, as text; None where no column states a plausible one."""
    for name, field in grounds:
        try:
            height = float(cell_text(record[field])) * units.metres_per_unit(name)
        except ValueError:
            continue
        if _GROUND_RANGE_M[0] < height < _GROUND_RANGE_M[1]:
            return f"{height:.4f}"
    return None


def cell_text(value: object) -> str:
    """Return the text of a cell, empty for null, NaN and blanks.

    Integers have no decimal point. A list of one value counts as the value, since GDAL converts a column to lists
    where one cell is a list.
    """
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):  # Overture: {"primary": name, ...}, {"value": surface, ...}
        return cell_text(value.get("primary", value.get("value")))
    if isinstance(value, float):
        return (
            ""
            if value != value
            else str(int(value))
            if value.is_integer() and abs(value) < MIN_INEXACT_INTEGER
            else str(value)
        )
    text = "" if value is None else str(value[:_MAX_CELL_LENGTH] if isinstance(value, str) else value).strip()
    return "" if text.lower() in ("nan", "none", "null", "<na>", "nat") else text


def assign_ids(records: list[dict[str, object]], columns: Mapping[str, str]) -> tuple[list[str], dict[str, str]]:
    """Assign an id to each record, and return the remarks on ids that differ from the column.

    The ids are from the first column with complete and unique values, else nearly so, else row numbers. In an incomplete column
    a missing id is row-N and a repeated one gets -2. OpenStreetMap ids become w12 and r12 where the type is known.

    Parameters
    ----------
    records : rows of a layer.
    columns : field by known column name.

    Returns
    -------
    ids : id of each record.
    remarks : remark by id.
    """
    kind = next((columns[name] for name in _ELEMENT_TYPE_COLUMNS if name in columns), None)
    nearly: tuple[list[str], str] | None = None
    stated = False
    for name in ID_COLUMNS:
        if name not in columns:
            continue
        texts = []
        for record in records:
            text = cell_text(record[columns[name]])
            if match := _OSM_ID.fullmatch(text):
                text = f"{match[1][0]}{match[2]}"
            elif text.isdigit() and kind is not None and name in ("id", "osmid", "osm_id"):
                text = f"{cell_text(record[kind])[:1].lower()}{text}"
            elif name == "osm_id" and "osm_way_id" in columns:  # GDAL: osm_id for relations, osm_way_id for ways
                way = cell_text(record[columns["osm_way_id"]])
                text = f"r{text}" if text else f"w{way}" if way else ""
            texts.append(text)
        stated = stated or any(texts)
        if all(texts) and len({*texts}) == len(texts):
            return texts, _inexact_ids(texts, records, columns[name])
        if nearly is None and len({*texts} - {""}) >= MIN_UNIQUE_SHARE * len(texts):
            nearly = texts, columns[name]
    if nearly is None:
        ids = [str(row) for row in range(len(records))]
        return ids, dict.fromkeys(ids if stated else (), _BY_ROW_REMARK)
    texts, field = nearly
    ids = _make_unique(texts)
    numbered = {id: _NUMBERED_REMARK for id, text in zip(ids, texts, strict=True) if text and id != text}
    return ids, _inexact_ids(ids, records, field) | numbered


def _inexact_ids(ids: list[str], records: Iterable[Mapping[str, object]], field: str) -> dict[str, str]:
    """Return the remark by id of numbers that a float, or its text by GDAL, cannot hold exactly."""
    cells = [record[field] for record in records]
    return {id: _INEXACT_REMARK for id, cell in zip(ids, cells, strict=True) if _is_inexact(cell)}


def _is_inexact(cell: object) -> bool:
    if isinstance(cell, float):
        return abs(cell) >= MIN_INEXACT_INTEGER
    return isinstance(cell, str) and _INEXACT_NUMBER.fullmatch(cell) is not None


def _make_unique(texts: list[str]) -> list[str]:
    """Return unique ids: missing and repeated ones are numbered."""
    ids: list[str] = []
    known = set(texts)
    seen: set[str] = set()
    for row, text in enumerate(texts):
        text = text or f"row-{row}"
        number = 2
        id = text
        while id in seen or (id != text and id in known):
            id, number = f"{text}-{number}", number + 1
        seen.add(id)
        ids.append(id)
    return ids


def _height_above_ground(
    record: Mapping[str, object], roofs: list[str], grounds: list[str], unit: float
) -> tuple[str, str] | None:
    """Return the height above the ground and the height of the ground, from heights above the datum."""
    roof, ground = (
        next((text for field in fields if (text := cell_text(record[field]))), "") for fields in (roofs, grounds)
    )
    try:
        return f"{(float(roof) - float(ground)) * unit:.2f}", ground if unit == 1.0 else f"{float(ground) * unit:.4f}"
    except ValueError:
        return None


def _parse_tags(value: object) -> dict[str, str]:
    """Return the tags of one cell: JSON, a mapping, or "key"=>"value" pairs."""
    if isinstance(value, str) and value.startswith("{"):
        try:
            value = json.loads(value)
        except (ValueError, RecursionError):
            return {}
    if isinstance(value, dict):
        return {str(key): text for key, stated in value.items() if (text := cell_text(stated))}
    return {key: stated for key, stated in _PAIR.findall(value)} if isinstance(value, str) else {}


def _primary_name(text: str) -> str:
    """Return a name; of a JSON object of names (Overture in GeoJSON) the primary one."""
    if text.startswith("{"):
        try:
            return str(json.loads(text).get("primary") or text)
        except (ValueError, RecursionError):
            return text
    return text
