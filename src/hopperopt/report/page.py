"""The stage `report`: one HTML file that holds everything that it shows and asks for nothing else."""

import base64
import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import jinja2
import numpy as np
import pandas as pd
import xarray as xr
import yaml

from hopperopt import dataset, files, uncertainty, verify
from hopperopt.figures import hopper, style
from hopperopt.report import answer, charts, drawing, facts
from hopperopt.surrogate import choice
from hopperopt.verdict import PRIMARY

TEMPLATES = Path(__file__).parent
# Figures of the study that the page shows, with what they show for who cannot see them.
ALTERNATIVES = {
    "effects": "Mean J of the designs at each level of each factor, with intervals of 90 %.",
    "indices": "Indices of segregation and flow of the plan's designs, the least segregating first.",
    "sensitivity": "Sobol' indices of the factors for each output.",
    "errors": "Errors of the surrogates, a line each; the numbers are in the table.",
    "fit": "Training targets and the network's curves in all experiments of the plan.",
    "front": "The predicted front, and the front among the simulated designs.",
    "verdict": "Predicted and simulated J of all cases with intervals; the numbers are in the table.",
    "verification": "Predicted and simulated outflow of the selected design.",
}
Runs = dict[tuple[str, int], xr.Dataset]


class Study(NamedTuple):
    """What the page is made of; the tables and data sets are those of the files of their names."""

    kinds: dict[str, str]  # of the verification cases, by name
    keys: dict[str, str]  # of the factors in the configuration
    data: xr.Dataset
    selected: dict
    front: pd.DataFrame
    verdict: pd.DataFrame
    validation: pd.DataFrame
    surrogate: xr.Dataset
    undetectable: list[str]
    plan: Runs  # without the particles
    verification: Runs

    def of_case(self, name: str) -> Runs:
        """The runs of a verification case."""
        return {key: run for key, run in self.verification.items() if key[0] == name}


def report(
    params: Mapping,
    data: str | os.PathLike,
    validation: str | os.PathLike,
    comparison: str | os.PathLike,
    surrogate: str | os.PathLike,
    front: str | os.PathLike,
    selected: str | os.PathLike,
    verdict: str | os.PathLike,
    simulations: Iterable,
    verification: Iterable,
    figures: Iterable[str | os.PathLike],
    output: str | os.PathLike,
) -> None:
    """Write report.html.

    params: `cases`, pairs of name and kind; `factors`, their names in order; `settings`, those of the stages,
    which are shown; `derived`, a dict with the factors' `keys`; `case_of`, a function of a design that
    returns its case, None where it cannot be built. The others are paths: dataset.nc, validation.csv,
    validation.nc, model.nc, front.csv, selected.yaml, verdict.csv, the plan's runs, the verification's runs,
    PNG files of figures.
    """
    study = Study(
        kinds=dict(params["cases"]),
        keys={name: params["derived"]["keys"][name] for name in params["factors"]},
        data=files.read_netcdf(data),
        selected=files.read_yaml(selected),
        front=files.read_table(front),
        verdict=files.read_table(verdict),
        validation=files.read_table(validation),
        surrogate=files.read_netcdf(surrogate),
        undetectable=choice.undetectable(choice.squared_errors(files.read_netcdf(comparison))),
        plan={key: run.drop_dims(run.dims) for key, run in dataset.read_runs(simulations).items()},
        verification=dict(dataset.read_runs(verification)),
    )
    text = render(study, params["settings"], params["case_of"], {Path(p).stem: p for p in figures})
    with files.atomic(output) as temporary:
        temporary.write_text(text, encoding="utf-8")


def render(
    study: Study,
    settings: Mapping,
    case_of: Callable[[Mapping], Mapping | None],
    figures: Mapping[str, str | os.PathLike],
) -> str:
    """The page; figures: PNG files by the figures' names."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"ensure_ascii": False, "allow_nan": False}
    strips = _strips(study)
    runs = study.plan | study.verification
    return environment.get_template("page.html").render(
        _opening(study)
        | _studied(study, settings)
        | _provenance(study, settings)
        | {
            "colours": style.COLOURS,
            "strips": strips,
            "surrogates": facts.surrogates(study.validation, study.surrogate.attrs["surrogate"]),
            "verdicts": _verdicts(study.verdict),
            "warnings": facts.warnings(study.selected, (study.plan, study.verification), study.undetectable),
            "times": facts.run_times(_groups(study)),
            "runs": facts.all_runs(runs),
            "figures": {name: _png(path) for name, path in figures.items()},
            "alternatives": ALTERNATIVES,
            "data": {
                "curves": charts.curves(study.data, list(study.keys)),
                "outflows": [strip.pop("outflow") for strip in strips],
                "front": _front(study, case_of),
            },
        }
    )


def _shown(study: Study, case: str) -> xr.Dataset:
    """The run of a case whose particles are drawn: the first that ended well, or else the first."""
    runs = list(study.of_case(case).values())
    return next((run for run in runs if run["status"].item() == "complete"), runs[0])


def _case(run: xr.Dataset) -> dict:
    return json.loads(run.attrs["case"])


def _drawing(case: Mapping) -> dict:
    """Outlines of a case's walls, and its levels in mm."""
    walls = hopper.walls_of(case)
    return {
        "hopper": drawing.outline(walls["hopper"]).path,
        "inside": drawing.inside(walls["hopper"]),
        "insert": drawing.outline(walls["insert"])._asdict() if "insert" in walls else None,
        "hopper_radius": walls["hopper"][:, 0].max(),
        "outlet": walls["gate"][:, 0].max(),
        "sensor": -drawing.PER_M * case["discharge"]["sensor"],
        "level": drawing.PER_M * case["filling"]["level"],
        "words": answer.design_words(case["design"]),
    }


def _opening(study: Study) -> dict:
    """The answer, with the hopper that it is about: the selected design's, or else the first case's."""
    shown = next((name for name, kind in study.kinds.items() if kind == PRIMARY), next(iter(study.kinds)))
    run = _shown(study, shown)
    case = _case(run)
    dropped = sum(len(dataset.unusable_runs(runs)) for runs in (study.plan, study.verification))
    lines, limits = drawing.dimensions(hopper.walls_of(case), drawing.PER_M * case["filling"]["level"])
    return {
        "answer": answer.answer(study.kinds, study.verdict, study.undetectable, dropped),
        "design": _in_words(study),
        "rule": study.selected["rule"],
        "shown": _drawing(case),
        "dimensions": lines,
        "drawing_box": drawing.view_box(limits),
        "letter": (limits[1] - limits[0]) / 34,
        "plain_box": drawing.view_box(drawing.extent([case], [run])),
        "half_angle": _half_angle(case),
    }


def _in_words(study):
    """The selected design with its factors' plain names."""
    names, design = facts.factor_words(study.keys), study.selected["design"]
    text = ", ".join(f"{names[name]} {charts.value_words(name, design[name])}" for name in study.keys)
    return text[0].upper() + text[1:]


def _half_angle(case):
    """Half angle (degrees) of the hopper's cone, from the vertical."""
    (r1, z1), (r2, z2) = case["walls"]["hopper"][:2]
    return float(np.degrees(np.arctan2(r2 - r1, z2 - z1)))


def _studied(study: Study, settings: Mapping) -> dict:
    run = next(iter(study.plan.values()))
    counts = [int(found["particle_count"]) for found in (study.plan | study.verification).values()]
    batch = study.data["target_fraction"].values
    return {
        "conditions": facts.conditions(_case(run), counts),
        "factors": facts.factors(study.data, study.keys, study.selected["design"]),
        "batch": [answer.percent(share, 1) for share in batch],
        "experiments": study.data.sizes["experiment"],
        "replicates": study.data.sizes["replicate"],
        "surrogate": facts.WORDS[study.surrogate.attrs["surrogate"]],
        "settings": yaml.safe_dump(settings, sort_keys=False, allow_unicode=True, width=100),
        "case": yaml.safe_dump(_case(run), sort_keys=False, allow_unicode=True, width=100),
    }


def _strips(study: Study) -> list[dict]:
    """Frames and outflow of each case simulated anew, all in one scale."""
    shown = {name: _shown(study, name) for name in study.kinds}
    cases = {name: _case(run) for name, run in shown.items()}
    limits = drawing.extent(list(cases.values()), list(shown.values()))
    usable = {
        name: [run for run in study.of_case(name).values() if run["status"].item() == "complete"]
        for name in shown
    }
    curves = charts.outflows(uncertainty.stacked([verify.curves(runs) for runs in usable.values()]))
    return [
        {
            "name": name,
            "title": name.replace("_", " "),
            "kind": facts.KINDS[study.kinds[name]],
            "box": drawing.view_box(limits),
            "limits": limits,
            "drawing": _drawing(cases[name]),
            "frames": drawing.frames(run, limits),
            "runs": len(usable[name]),
            "time": np.mean([float(run["discharge_time"]) for run in usable[name]]) if usable[name] else None,
            "outflow": curve,
        }
        for (name, run), curve in zip(shown.items(), curves, strict=True)
    ]


def _front(study: Study, case_of: Callable) -> dict:
    def walls_of(design):
        case = case_of(design)
        return None if case is None else hopper.walls_of(case)

    names = list(facts.factor_words(study.keys).values())
    return {"factors": names, "points": charts.front(study.front, list(study.keys), walls_of)}


def _verdicts(table: pd.DataFrame) -> facts.Rows:
    """Rows of verdict.csv in words."""
    return [
        (
            row["case"].replace("_", " "),
            row["objective"],
            f"{row['n']:.0f}",
            answer.decimals(row["predicted"]),
            _interval(row, "simulated", "low", "high", answer.decimals),
            _interval(row, "diff_bare", "diff_low", "diff_high", answer.power),
            row["verdict"] if isinstance(row["verdict"], str) else "",
        )
        for _, row in table.iterrows()
    ]


def _interval(row, value, low, high, words):
    if np.isnan(row[value]):
        return ""
    limits = f" ({words(row[low])} to {words(row[high])})" if np.isfinite(row[low]) else ""
    return words(row[value]) + limits


def _groups(study: Study) -> dict[str, Runs]:
    """The runs by what they are for."""
    return {"plan": study.plan} | {name.replace("_", " "): study.of_case(name) for name in study.kinds}


def _provenance(study: Study, settings: Mapping) -> dict:
    simulated = [run.attrs for run in (study.plan | study.verification).values()]
    made = {
        "simulations": simulated,
        "data set": [study.data.attrs],
        "surrogate": [study.surrogate.attrs],
    }
    return {
        "origins": facts.origins(made),
        "versions": facts.versions([attributes for group in made.values() for attributes in group]),
    }


def _png(path: str | os.PathLike) -> str:
    return f"data:image/png;base64,{base64.b64encode(Path(path).read_bytes()).decode()}"
