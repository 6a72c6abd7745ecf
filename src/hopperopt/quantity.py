"""The one way in which the configuration reads a number."""

import math
import re
from dataclasses import dataclass
from numbers import Real

from hopperopt.document import NotAllowed

PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
WHOLE = re.compile(r"[+-]?\d{1,300}", re.ASCII)
INFINITE = ("inf", ".inf", "Infinity")


@dataclass(frozen=True)
class Quantity:
    """Bounds of a number, and how it may be typed.

    YAML reads 5e-4 as text, and Snakemake's --config gives text, so that text which plainly is a number
    counts as one. Booleans, NaN and (unless `infinite`) infinity do not.
    """

    above: float | None = None
    least: float | None = None
    below: float | None = None
    most: float | None = None
    infinite: bool = False

    def read(self, value, whole=False, words=()):
        """A float (an int where `whole`), or one of `words` (null is None) as it is; raises NotAllowed."""
        if any(value is word or (isinstance(value, str) and value == word) for word in words):
            return value
        number = _number(value) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, Real) or not self._holds(number, whole):
            raise NotAllowed(self.described(whole, words))
        return int(number) if whole else float(number)

    def _holds(self, number, whole):
        try:
            finite = math.isfinite(number)
        except OverflowError:  # an integer beyond all floats
            return False
        if not finite:
            return self.infinite and number > 0
        return (
            (not whole or number == int(number))
            and (self.above is None or number > self.above)
            and (self.least is None or number >= self.least)
            and (self.below is None or number < self.below)
            and (self.most is None or number <= self.most)
        )

    def described(self, whole=False, words=()):
        """What is allowed, in words."""
        bounds = {"above": self.above, "at least": self.least, "below": self.below, "at most": self.most}
        limits = " and ".join(f"{word} {bound:g}" for word, bound in bounds.items() if bound is not None)
        number = " ".join(filter(None, ["a whole number" if whole else "a number", limits]))
        others = [".inf"] if self.infinite else []
        return " or ".join([number, *others, *(word or "null" for word in words)])


def _number(text):
    """The number that a text plainly is, or None."""
    text = text.strip()
    if WHOLE.fullmatch(text):
        return int(text)
    if PLAIN.fullmatch(text):
        return float(text)
    return math.inf if text in INFINITE else None
