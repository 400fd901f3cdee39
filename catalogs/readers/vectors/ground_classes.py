"""OpenStreetMap tags for the ground classes and words of other maps."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from facade_core.core.street_objects import object_tag_values

# OpenStreetMap tag -> words of other sources: values of class columns or names of layers, in lower case and singular, with
# underscores for punctuation.
_AREA_WORDS = {
    "leisure=park": "park parc public_park parkanlage",
    "leisure=garden": "garden jardin garten tuin flowerbed",
    "leisure=pitch": "pitch sports_pitch sports_field sportveld sportplatz",
    "leisure=playground": "playground spielplatz speelplaats aire_de_jeux",
    "landuse=grass": "grass lawn verge green greenery green_area green_space vegetation groenvoorziening gruenflaeche "
    "gruenanlage gras rasen pelouse espace_vert allotment orchard vineyard heath",
    "landuse=meadow": "meadow grassland wiese weide prairie",
    "landuse=forest": "forest wood woodland tree_cover wald bos loofbos naaldbos gemengd_bos foret",
    "natural=scrub": "scrub shrub shrubland struiken",
    "landuse=cemetery": "cemetery graveyard grave_yard friedhof begraafplaats cimetiere",
    "natural=water": "water lake pond reservoir river canal riverbank dock basin gewaesser wasser wasserflaeche waterloop "
    "watervlakte eau plan_d_eau surface_hydrographique",
    "natural=sand": "sand beach strand zand plage",
    "landuse=construction": "construction construction_site brownfield baustelle",
    "place=square": "square plaza plein platz yard courtyard hof erf cour",
    "area:highway=footway": "footway sidewalk pavement trottoir gehweg voetpad pedestrian pedestrian_area "
    "voetgangersgebied fussgaengerzone",
    "area:highway=residential": "road roadway carriageway street rijbaan_lokale_weg rijbaan_regionale_weg rijbaan "
    "fahrbahn chaussee",
    "area:highway=cycleway": "cycleway cycle_track bike_path radweg fietspad piste_cyclable",
    "amenity=parking": "parking parking_lot parking_surface car_park parkplatz parkeervlak parkeerplaats stationnement",
}
TAGS_BY_AREA_WORD = {word: tag for tag, words in _AREA_WORDS.items() for word in words.split()}
# OpenStreetMap value of `highway` -> words of other sources: TIGER codes, classes of Overture, Geofabrik and cities.
_HIGHWAY_WORDS = {
    "motorway": "motorway type_autoroutier freeway expressway interstate autobahn autosnelweg autoroute s1100",
    "trunk": "trunk",
    "primary": "primary arterial major_arterial principal_arterial bundesstrasse s1200",
    "secondary": "secondary minor_arterial landesstrasse",
    "tertiary": "tertiary collector minor_collector major_collector kreisstrasse",
    "unclassified": "unclassified route_a_1_chaussee route_a_2_chaussees rond_point",
    "residential": "residential local local_street local_road neighborhood neighbourhood gemeindestrasse woonstraat s1400",
    "living_street": "living_street home_zone woonerf spielstrasse",
    "service": "service alley driveway access_road s1730 s1740 s1780",
    "pedestrian": "pedestrian pedestrian_street pedestrian_zone fussgaengerzone voetgangersgebied",
    "footway": "footway walkway sidewalk trail gehweg fussweg voetpad trottoir s1710",
    "steps": "steps escalier stairs stairway treppe s1720",
    "cycleway": "cycleway bike_path bicycle_path cycle_path cycle_track radweg fietspad piste_cyclable s1820",
    "path": "path sentier",
    "track": "track feldweg chemin route_empierree s1500",
    "crossing": "crossing crosswalk pedestrian_crossing zebra zebra_crossing",
}
HIGHWAYS_BY_WORD = {word: value for value, words in _HIGHWAY_WORDS.items() for word in words.split()}
# OpenStreetMap value of `surface` -> words of other sources.
_SURFACE_WORDS = {
    "asphalt": "asphalte bitumen tarmac paved enrobe bitume asfalt gesloten_verharding beton",
    "paving_stones": "paving pavers tegels klinkers open_verharding platten dalles brick_paving",
    "sett": "setts cobbles cobble cobblestones pflaster kopfsteinpflaster paves natuursteen granite",
    "gravel": "half_verhard kies schotter grind gravier onverhard unbound dirt_road wassergebunden",
    "grass": "gras rasen herbe turf",
}
SURFACES_BY_WORD = {word: value for value, words in _SURFACE_WORDS.items() for word in words.split()}
# OpenStreetMap tag of an object -> words of other sources; the value of a tag is a word for itself.
_OBJECT_WORDS = {
    "natural=tree": "baum boom arbre arbol albero street_tree",
    "natural=tree_row": "baumreihe bomenrij",
    "highway=street_lamp": "street_light streetlight lamp_post lamppost lantaarnpaal lichtmast laterne lampadaire",
    "amenity=bench": "sitzbank zitbank banc",
    "amenity=waste_basket": "litter_bin afvalbak muelleimer corbeille",
    "barrier=bollard": "paal poller borne",
    "barrier=hedge": "haag hecke haie",
    "barrier=fence": "hek zaun cloture",
}
TAGS_BY_OBJECT_WORD = {value: f"{key}={value}" for key, values in object_tag_values().items() for value in values} | {
    word: tag for tag, words in _OBJECT_WORDS.items() for word in words.split()
}
_TRAM_WORDS = frozenset(("tram", "tramway", "light_rail", "strassenbahn", "streetcar", "trambaan"))
# Words for yes and no, and the OpenStreetMap value of an unspecified yes.
_YES_WORDS = frozenset(("yes", "true", "t", "1", "ja", "oui", "y", "j", "si", "sí", "sim", "tak", "kyllä", "ano"))
_NO_WORDS = frozenset(("no", "false", "f", "0", "nee", "nein", "non", "n", "none"))
_VALUES_OF_YES = {
    "cycleway": "track",
    "parking": "lane",
    "sidewalk": "yes",
    "oneway": "yes",
    "tunnel": "yes",
    "covered": "yes",
}
_ONE_WAY_WORDS = frozenset(("ft", "tf", "sens_direct", "sens_inverse"))


def normalize_word(text: str) -> str:
    """Return a class word in lower case, with underscores and without umlauts, as the tables of words have it."""
    word = "_".join(re.findall(r"\w+", text.lower()))
    for letter, letters in (("ü", "ue"), ("ä", "ae"), ("ö", "oe"), ("ß", "ss"), ("é", "e"), ("ê", "e"), ("à", "a")):
        word = word.replace(letter, letters)
    return word


def osm_ground_tags(tags: Mapping[str, str], layer: str = "", *, is_area: bool = False) -> dict[str, str]:
    """Return a ground feature's OpenStreetMap tags, with classes and layer names of other maps translated.

    Parameters
    ----------
    tags : as catalogs.readers.vectors.columns returns them; `class` has the values of all class columns, one per line.
    layer : name of the layer.
    is_area : True for an outline, False for a line or point.
    """
    found = {key: value for key, value in tags.items() if key != "class"}
    words = [normalize_word(one) for one in (*tags.get("class", "").split("\n"), layer)]
    meant = _look_up_words(words, TAGS_BY_AREA_WORD) if is_area else None
    if meant := meant or _look_up_words(words, TAGS_BY_OBJECT_WORD):
        key, _, tag_value = meant.partition("=")
        found[key] = tag_value
    elif not is_area and "railway" not in found:
        found |= _way_class(found, words)
    if "surface" in found:
        found["surface"] = SURFACES_BY_WORD.get(normalize_word(found["surface"]), found["surface"])
    return found | {
        key: value for key, text in found.items() if (value := _value_of_yes_no(key, normalize_word(text))) is not None
    }


def _way_class(tags: Mapping[str, str], words: Sequence[str]) -> dict[str, str]:
    """Return the tag of a tram or street that words name; none where the tags state a street."""
    if not _TRAM_WORDS.isdisjoint(words):
        return {"railway": "tram"}
    street = _look_up_words(words, HIGHWAYS_BY_WORD)
    is_stated = tags.get("highway", "").removesuffix("_link") in HIGHWAYS_BY_WORD
    return {"highway": street} if street and not is_stated else {}


def _look_up_words(words: Sequence[str], table: Mapping[str, str]) -> str | None:
    """Return the entry of the first known word, singular or plural."""
    return next(filter(None, (table.get(word, table.get(word.removesuffix("s"))) for word in words)), None)


def _value_of_yes_no(key: str, word: str) -> str | None:
    """Return OpenStreetMap's value for a yes or no; None for any other value."""
    thing = key.partition(":")[0]
    if thing not in _VALUES_OF_YES or key.endswith(":width"):
        return None
    if word in _YES_WORDS or (thing == "oneway" and word in _ONE_WAY_WORDS):
        return _VALUES_OF_YES[thing]
    return "no" if word in _NO_WORDS else None
