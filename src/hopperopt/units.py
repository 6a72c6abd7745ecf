"""Units of keys and factors, which their names end with."""

from typing import NamedTuple


class Unit(NamedTuple):
    """A unit as the CF conventions spell it, and as it is read after a number."""

    cf: str
    words: str


UNITS = {
    "mm": Unit("mm", " mm"),
    "deg": Unit("degree", "°"),
    "pa": Unit("Pa", " Pa"),
    "kg_m3": Unit("kg m-3", " kg/m³"),
    "m_s": Unit("m s-1", " m/s"),
    "m_s2": Unit("m s-2", " m/s²"),
    "s": Unit("s", " s"),
    "minutes": Unit("min", " min"),
}
NONE = Unit("1", "")


def split(name: str) -> tuple[str, Unit]:
    """A name without its unit, and the unit: length_mm gives length and mm; NONE where it has none."""
    fitting = [end for end in UNITS if name.endswith(f"_{end}")]
    if not fitting:
        return name, NONE
    end = max(fitting, key=len)
    return name.removesuffix(f"_{end}"), UNITS[end]
