"""The page's tables: what was studied, warnings, by what the files were made, how long it took."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd
import xarray as xr

from hopperopt import dataset, outflow, units
from hopperopt.figures.errors import WORDS
from hopperopt.report import answer

Rows = list[tuple[str, ...]]
ROLLING = {"edem": "as in EDEM", "cdt": "as in LIGGGHTS (cdt)", "none": "none"}
KINDS = {
    "selected": "what the study selected from the front",
    "best_f": "the front's end with the smallest predicted J of the fine particles",
    "best_i": "the front's end with the smallest predicted J of the intermediate particles",
    "plan_best": "of the plan's experiments the one that segregated least",
    "plan_centre": "the middle levels of all factors",
    "bare": "the hopper without an insert",
    "design": "a design named in the configuration",
}


def conditions(case: Mapping, counts: Iterable[int], levels: Sequence[float]) -> Rows:
    """What all simulations share, (quantity, value).

    case: of one of them; counts: their particle numbers; levels (mm): of their settled beds.
    """
    spheres, wall, contact, filling = (case[name] for name in ("particles", "wall", "contact", "filling"))
    diameters = [f"{1e3 * d:.3g}" for d in spheres["diameters"]]
    names = ", ".join(f"{k} {d} mm" for k, d in zip(outflow.SIZE_CLASSES, diameters, strict=True))
    rows = [
        ("particles in one filling", f"{_span(counts)} spheres, equal numbers of each size"),
        ("diameters", names),
        ("density of the particles", f"{spheres['density']:.4g} kg/m³"),
    ]
    for key, name, words in (
        ("shear_modulus", "shear modulus", _pascal), ("poisson_ratio", "Poisson's ratio", _short)
    ):  # fmt: skip
        rows.append((f"{name}, particles and walls", _two(words, spheres[key], wall[key])))
    for key, name in (
        ("static_friction", "friction"),
        ("rolling_friction", "rolling friction"),
        ("restitution", "restitution"),
    ):  # fmt: skip
        pair = _two(_short, contact["particle"][key], contact["wall"][key])
        rows.append((f"{name}, between particles and with walls", pair))
    reached = " to ".join(dict.fromkeys(f"{level:.3g}" for level in (min(levels), max(levels))))
    return [
        *rows,
        ("rolling resistance", ROLLING.get(contact["rolling"], contact["rolling"])),
        ("settled bed", f"{reached} mm above the outlet, aimed at {1e3 * filling['level']:.4g} mm"),
        ("counted as discharged", f"{-1e3 * case['discharge']['sensor']:.3g} mm below the outlet"),
        ("time step", f"{1e6 * case['time_step']:.3g} µs"),
    ]


def _two(words, first, second):
    return f"{words(first)}, {words(second)}"


def _short(value):
    return f"{value:.3g}"


def _pascal(value):
    return "rigid" if np.isinf(value) else f"{value / 1e6:.3g} MPa"


def _span(values):
    low, high = min(values), max(values)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"


def factor_words(keys: Mapping[str, str]) -> dict[str, str]:
    """Plain names of factors, from the keys that they vary: `slope` of insert.cone.slope_deg.

    Where two would be called the same, the part of the key before is named as well.
    """
    parts = {name: key.split(".") for name, key in keys.items()}
    last = {name: units.split(part[-1])[0] for name, part in parts.items()}
    clear = Counter(last.values())
    return {
        name: (word if clear[word] == 1 else f"{parts[name][-2]} {word}").replace("_", " ")
        for name, word in last.items()
    }


def factors(data: xr.Dataset, keys: Mapping[str, str], selected: Mapping[str, float]) -> Rows:
    """(name, symbol, key of the configuration, range in the plan, values in it, selected value)."""
    words = factor_words(keys)
    rows: Rows = []
    for name, key in keys.items():
        values, unit = np.unique(data[name].values), answer.plain(answer.style.factor_parts(name)[1])
        span = f"{values.min():.4g} to {values.max():.4g}{unit}"
        symbol = answer.plain(answer.style.factor_parts(name)[0])
        value = f"{selected[name]:.4g}{unit}"
        rows.append((words[name], symbol, key, span, f"{len(values)}", value))
    return rows


def warnings(
    selected: Mapping, runs: Sequence[Mapping[tuple[str, int], xr.Dataset]], undetectable: Iterable[str]
) -> list[str]:
    """Sentences: of the selection, of beds that missed their level, of runs that are no data points.

    selected: as in selected.yaml; runs: those of the plan and those of the verification.
    """
    found = (selected["warning"] or "").split("; ")
    lost = "no effect of the design is detectable in the objective of the {} particles"
    found += [lost.format(objective) for objective in undetectable]
    for group in runs:
        found.append(dataset.missed_levels(group) or "")
        unusable = dataset.unusable_runs(group)
        found += [f"{name}, filling {number}: {why}" for (name, number), why in unusable.items()]
    return [f"{text[0].upper()}{text[1:]}." for text in found if text]


def surrogates(table: pd.DataFrame, chosen: str) -> list[dict]:
    """Rows of validation.csv in words: `name`, `used` and the `values` of the columns that the page shows."""
    table = table.set_index("method")
    columns = ("curve_rmse_f", "curve_rmse_i", "objective_f_rmse", "objective_i_rmse")
    return [
        {
            "name": WORDS[name],
            "used": name == chosen,
            "values": [
                *(answer.decimals(table.loc[name, column]) for column in columns),
                answer.percent(table.loc[name, "coverage_90"]),
            ],
        }
        for name in WORDS
        if name in table.index
    ]


def run_times(groups: Mapping[str, Mapping[tuple[str, int], xr.Dataset]]) -> Rows:
    """A row for each group of runs: (name, runs, shortest, mean, longest, all, speed), and one for all."""
    rows: Rows = []
    everything: dict[tuple, xr.Dataset] = {}
    for name, runs in groups.items():
        everything |= {(name, *key): run for key, run in runs.items()}
        rows.append((name, *_times(runs.values())))
    return [*rows, ("all", *_times(everything.values()))]


def _times(runs):
    seconds = np.array([run.attrs.get("wall_time_s", np.nan) for run in runs])
    speed = np.array([run.attrs.get("particle_steps_per_s", np.nan) for run in runs])
    return (
        f"{len(seconds)}",
        *map(duration, (seconds.min(), seconds.mean(), seconds.max(), seconds.sum())),
        f"{speed.mean() / 1e6:.2f}",
    )


def duration(seconds: float) -> str:
    """A time in the unit that suits it; empty for NaN."""
    if np.isnan(seconds):
        return ""
    for size, unit in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"


def origins(attributes: Mapping[str, Sequence[Mapping]]) -> Rows:
    """By what files were made: (files, made, git, hopperopt, solver, host), a row for each way.

    attributes: those of the netCDF files, by what the page calls them.
    """
    rows = []
    for name, group in attributes.items():
        ways: dict[tuple, list[str]] = {}
        for found in group:
            way = tuple(found.get(key, "") for key in ("git", "hopperopt_version", "code_digest", "host"))
            ways.setdefault(way, []).append(found.get("created", ""))
        for way, times in ways.items():
            count = f"{name} ({len(times)})" if len(ways) > 1 else name
            rows.append((count, _between(times), *way))
    return rows


def _between(times):
    first, last = (f"{time[:10]} {time[11:16]} UTC" for time in (min(times), max(times)))
    return first if first == last else f"{first} to {last}"


def versions(attributes: Iterable[Mapping]) -> list[str]:
    """The libraries with their versions, once for each set of them that made a file."""
    found = dict.fromkeys(item.get("versions", "{}") for item in attributes)
    return [", ".join(f"{name} {number}" for name, number in json.loads(text).items()) for text in found]


def all_runs(runs: Mapping[tuple[str, int], xr.Dataset]) -> Rows:
    """(run, filling, seed, status, discharge time, run time) of each run."""
    return [
        (
            name,
            f"{number}",
            f"{run.attrs.get('seed', '')}",
            str(run["status"].item()),
            f"{float(run['discharge_time']):.3f} s",
            duration(run.attrs.get("wall_time_s", np.nan)),
        )
        for (name, number), run in runs.items()
    ]
