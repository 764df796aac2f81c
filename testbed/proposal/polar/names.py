"""Columns of directions and ranges, as instruments and their users call them."""

from collections.abc import Collection

WORDS = {
    "azimuth": {"azimuth", "azimut", "az", "azi", "acimut", "hz", "ha", "h angle", "hz angle",
                "hz winkel", "horizontal", "horizontal angle", "horizontal direction",
                "horizontalwinkel", "horizontalrichtung", "angle horizontal",
                "angolo orizzontale", "ángulo horizontal", "方位角", "水平角"},
    "elevation": {"elevation", "elevation angle", "el", "elev", "height angle", "höhenwinkel"},
    "zenith": {"zenith", "zen", "zenith angle", "zenith distance", "zenit", "zenitwinkel",
               "zenithwinkel", "天顶角", "天頂角"},
    "vertical": {"vertical", "vertical angle", "v", "va", "v angle", "vertikalwinkel",
                 "angle vertical", "angolo verticale", "ángulo vertical", "垂直角"},
    "range": {"range", "distance", "dist", "d", "sd", "slope distance", "slope dist",
              "slant distance", "slant range", "r", "s", "radius", "strecke", "schrägstrecke",
              "schrägdistanz", "distanz", "distanza", "distancia", "斜距", "距離"},
}  # fmt: skip
"""A vertical angle is that from the zenith, or that above the horizon."""
HEIGHTS = ("elevation", "zenith", "vertical")
SURVEYED = ("h", "水")
"""What names of directions begin with that surveyors count, who do so clockwise."""


def polar_names(texts: Collection[str]) -> dict[str, str]:
    """Stems of small words that are an azimuth, a height and a range: one of each, or none."""
    found = {stem: words.intersection(texts) for stem, words in WORDS.items()}
    heights = [stem for stem in HEIGHTS if found[stem]]
    used = ("azimuth", *heights, "range")
    if len(heights) != 1 or any(len(found[stem]) != 1 for stem in used):
        return {}
    return {text: stem for stem in used for text in found[stem]}
