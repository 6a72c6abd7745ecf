"""What a field of a section may be: quantities with bounds, as annotations."""

from typing import Annotated, get_args

from pydantic import BaseModel, ConfigDict, StringConstraints
from pydantic_core import core_schema

from hopperopt.quantity import Quantity

MM = 1000.0  # millimetres in a metre; dividing by it rounds once, so that 22.5 mm is 0.0225 m


class Number(Quantity):
    """A quantity as an annotation: `Annotated[float | Literal["auto"], Number(above=0)]`."""

    def __get_pydantic_core_schema__(self, source, handler):
        """Read the number first; what pydantic then checks already has the annotated type."""
        kinds = [get_args(kind)[0] if get_args(kind) else kind for kind in get_args(source) or (source,)]
        words = [None if kind is type(None) else kind for kind in kinds if kind not in (int, float)]

        def read(value):
            return self.read(value, int in kinds, words)

        return core_schema.no_info_before_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(self, core, handler):
        """The annotated type with the bounds where it is a number."""
        made = handler(core)
        bounds = {
            "exclusiveMinimum": self.above,
            "minimum": self.least,
            "exclusiveMaximum": self.below,
            "maximum": None if self.infinite else self.most,
        }
        for kind in made.get("anyOf", [made]):
            if kind.get("type") in ("number", "integer"):
                kind |= {word: bound for word, bound in bounds.items() if bound is not None}
        return made


Seconds = Annotated[float, Number(above=0, most=10_000)]
Length = Annotated[float, Number(least=0.001, most=100_000)]  # from a micrometre
Coordinate = Annotated[float, Number(least=-100_000, most=100_000)]
Slope = Annotated[float, Number(least=1, most=89)]
Density = Annotated[float, Number(least=10, most=100_000)]
Speed = Annotated[float, Number(least=0, most=100)]
Friction = Annotated[float, Number(least=0, most=10)]
Share = Annotated[float, Number(least=0, most=1)]
Finite = Annotated[float, Number()]
Count = Annotated[int, Number(least=1, most=10_000)]
Nodes = Annotated[int, Number(least=1, most=200)]
Seed = Annotated[int, Number(least=0, most=2**63 - 1)]
Poisson = Annotated[float, Number(least=0, most=0.5)]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$")]


class Model(BaseModel):
    """A section: frozen, no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
