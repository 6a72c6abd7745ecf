"""What the study found, in whole sentences, whatever it found."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from hopperopt.figures import style
from hopperopt.surrogate.features import OUTPUTS
from hopperopt.uncertainty import LEVEL
from hopperopt.verdict import BARE, PRIMARY

FAR = 2.0  # standard deviations at which a simulation counts as off its prediction
CLAUSES = {
    "better": "the {} particles segregate less",
    "worse": "the {} particles segregate more",
    "not distinguishable": "no difference can be told for the {} particles",
}


class Answer(NamedTuple):
    """The headline, and the sentences below it."""

    headline: str
    details: list[str]


def answer(
    cases: Mapping[str, str], verdict: pd.DataFrame, undetectable: Iterable[str] = (), dropped: int = 0
) -> Answer:
    """What the verification says of the selected design.

    cases: kind of each verification case by name; verdict: as in verdict.csv; undetectable: size classes in
    whose objective no effect of the design was found; dropped: number of runs that were left out.
    """
    primary, bare = (_named(cases, kind) for kind in (PRIMARY, BARE))
    details = []
    if primary is None:
        headline = "The study simulated no selected design anew, so that it gives no verdict."
    else:
        rows = {name: _rows(verdict, name) for name in (primary, bare) if name is not None}
        headline = _headline(rows[primary], rows.get(bare))
        if rows[primary]["simulated"].notna().all():
            details += [_objective(k, rows[primary].loc[k], rows.get(bare)) for k in OUTPUTS]
            details += _predictions(rows[primary])
    if lost := list(undetectable):
        details.append(
            f"No effect of the design was found on how the {_join(lost)} particles segregate: of experiments "
            "that they had not seen, the surrogates say no more than the mean of the others does. In that "
            "respect the selected design is as good a guess as any other of the plan."
        )
    if dropped:
        details.append(
            f"{dropped} run{'s' if dropped > 1 else ''} did not end well and "
            f"{'are' if dropped > 1 else 'is'} left out of all results (see the warnings)."
        )
    return Answer(headline, details)


def _named(cases, kind):
    return next((name for name, own in cases.items() if own == kind), None)


def _rows(verdict, case):
    return verdict[verdict["case"] == case].set_index("objective").loc[list(OUTPUTS)]


def _headline(selected, bare):
    """One sentence on the selected design against the bare hopper; rows by objective, or None without one."""
    if selected["simulated"].isna().any():
        return "No simulation of the selected design ended well, so that nothing can be said of it."
    if bare is None:
        return "The study simulated no bare hopper with which the selected design could be compared."
    if bare["simulated"].isna().any():
        return "No simulation of the bare hopper ended well, to which the selected design could be compared."
    found = {}
    for name in OUTPUTS:
        found.setdefault(selected.loc[name, "verdict"], []).append(name)
    clauses = [CLAUSES[word].format(_join(names)) for word, names in found.items()]
    return f"With the selected design, compared with the bare hopper, {', and '.join(clauses)}."


def _join(names):
    return " and the ".join(names)


def _objective(name, row, bare):
    """Sentences on one objective of the selected design."""
    text = f"{name.capitalize()} particles: J is {_value(row)}"
    if bare is None or np.isnan(bare.loc[name, "simulated"]):
        return f"{text}."
    other = bare.loc[name]
    text += f", in the bare hopper {_value(other)}. "
    ratio = row["simulated"] / other["simulated"] - 1
    change = f", by {percent(abs(ratio))}" if min(row["simulated"], other["simulated"]) > 0 else ""
    if row["verdict"] == "better":
        p = f"= {row['p_holm']:.2g}" if row["p_holm"] >= 0.001 else "< 0.001"
        return text + f"That is less{change} (one-sided test, p {p})."
    if row["verdict"] == "worse":
        return text + f"That is more{change} (one-sided test at {percent(LEVEL)})."
    return text + (
        "The two cannot be told apart: the difference of J² lies between "
        f"{power(row['diff_low'])} and {power(row['diff_high'])}."
    )


def _value(row):
    """J with its interval and number of simulations."""
    limits = f"{decimals(row['low'])} to {decimals(row['high'])}"
    interval = "" if np.isnan(row["low"]) else f"90\u00a0% interval {limits}, "
    runs = int(row["n"])
    return f"{decimals(row['simulated'])} ({interval}{runs} simulation{'s' if runs != 1 else ''})"


def _predictions(rows):
    """A sentence on the predictions of the selected design, if there are any."""
    if rows[["predicted", "z"]].isna().any(axis=None):
        return []
    values = "J of " + " and ".join(f"{decimals(rows.loc[k, 'predicted'])} ({k})" for k in OUTPUTS)
    far = [k for k in OUTPUTS if abs(rows.loc[k, "z"]) > FAR]
    if not far:
        return [f"The surrogate had predicted {values}; the simulations agree with that within their noise."]
    sides = [f"{'above' if rows.loc[k, 'z'] > 0 else 'below'} it for the {k} particles" for k in far]
    return [
        f"The surrogate had predicted {values}; the simulations lie plainly "
        f"(by more than {FAR:g} standard deviations) {' and '.join(sides)}."
    ]


def decimals(value: float) -> str:
    """A value of J with four decimals and a true minus; empty for NaN."""
    return "" if np.isnan(value) else f"{value:.4f}".replace("-", "−")


def percent(share: float, digits: int = 0) -> str:
    """A share as a percentage; empty for NaN."""
    return "" if np.isnan(share) else f"{100 * share:.{digits}f}\u00a0%"


def power(value: float) -> str:
    """A small number such as −1.6·10⁻³; empty for NaN."""
    if np.isnan(value):
        return ""
    mantissa, exponent = f"{value:.1e}".split("e")
    raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa}·10{raised}".replace("-", "−")


def design_words(design: Mapping[str, float]) -> str:
    """A design in plain words: θ = 55°, L = 40 mm."""
    return plain(style.design_text(design))


def plain(text: str) -> str:
    """A text of the figures without their markup."""
    return text.replace(r"$\theta$", "θ").replace("$", "")
