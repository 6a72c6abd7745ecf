"""What the sections of the page show beside its charts: variables of page.html."""

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd
import xarray as xr
import yaml

from hopperopt import dataset, uncertainty, verify
from hopperopt.figures import hopper
from hopperopt.report import answer, charts, drawing, facts
from hopperopt.report.study import Runs, Study, case
from hopperopt.verdict import PRIMARY


def opening(study: Study) -> dict:
    """The answer, with the hopper that it is about: the selected design's, or else the first case's."""
    name = next((name for name, kind in study.kinds.items() if kind == PRIMARY), next(iter(study.kinds)))
    run = study.shown(name)
    shown = case(run)
    dropped = sum(len(dataset.unusable_runs(runs)) for runs in (study.plan, study.infill, study.verification))
    level = _level(run)
    lines, limits = drawing.dimensions(hopper.walls_of(shown), level)
    return {
        "answer": answer.answer(study.kinds, study.verdict, study.undetectable, dropped),
        "design": _in_words(study),
        "rule": study.selected["rule"],
        "shown": _drawing(shown),
        "level": level,
        "dimensions": lines,
        "drawing_box": drawing.view_box(limits),
        "letter": (limits[1] - limits[0]) / 34,
        "plain_box": drawing.view_box(drawing.extent([shown], [run])),
        "half_angle": _half_angle(shown),
    }


def _in_words(study):
    """The selected design with its factors' plain names, and of what they are where all are the insert's."""
    design = study.selected["design"]
    parts = [f"{word} {charts.value_words(name, design[name])}" for name, word in study.words().items()]
    of_insert = all(key.startswith("insert.") for key in study.keys.values())
    text = "insert: " * of_insert + ", ".join(parts)
    return text[0].upper() + text[1:]


def _half_angle(case):
    """Half angle (degrees) of the hopper's cone, from the vertical."""
    (r1, z1), (r2, z2) = case["walls"]["hopper"][:2]
    return float(np.degrees(np.arctan2(r2 - r1, z2 - z1)))


def _level(run: xr.Dataset) -> float:
    """Level (mm) of a run's settled bed; what it should have been of a filling that blew up."""
    reached = float(run["filling_level"])
    return drawing.PER_M * (reached if np.isfinite(reached) else case(run)["filling"]["level"])


def _drawing(case: Mapping) -> dict:
    """Outlines of a case's walls, in mm."""
    walls = hopper.walls_of(case)
    return {
        "hopper": drawing.outline(walls["hopper"]).path,
        "inside": drawing.inside(walls["hopper"]),
        "insert": drawing.outline(walls["insert"])._asdict() if "insert" in walls else None,
        "hopper_radius": walls["hopper"][:, 0].max(),
        "outlet": walls["gate"][:, 0].max(),
        "sensor": -drawing.PER_M * case["discharge"]["sensor"],
        "words": answer.design_words(case["design"]),
    }


def studied(study: Study, settings: Mapping) -> dict:
    """What was studied, and how."""
    first = case(next(iter(study.plan.values())))
    runs = (study.plan | study.verification).values()
    counts, levels = [int(run["particle_count"]) for run in runs], [_level(run) for run in runs]
    batch = study.data["target_fraction"].values
    return {
        "conditions": facts.conditions(first, counts, levels),
        "factors": facts.factors(study.data, study.keys, study.selected["design"]),
        "batch": [answer.percent(share, 1) for share in batch],
        "experiments": study.data.sizes["experiment"],
        "replicates": study.data.sizes["replicate"],
        "surrogate": facts.WORDS[study.surrogate.attrs["surrogate"]],
        "settings": yaml.safe_dump(settings, sort_keys=False, allow_unicode=True, width=100),
        "case": yaml.safe_dump(first, sort_keys=False, allow_unicode=True, width=100),
    }


def discharge(study: Study) -> dict:
    """Frames of each case simulated anew, all in one scale."""
    shown = {name: study.shown(name) for name in study.kinds}
    cases = {name: case(run) for name, run in shown.items()}
    limits = drawing.extent(list(cases.values()), list(shown.values()))
    usable = {name: study.usable(name) for name in shown}
    strips = [
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
        }
        for name, run in shown.items()
    ]
    return {"strips": strips}


def outflows(study: Study) -> list[dict]:
    """Mean outflow of each case simulated anew."""
    return charts.outflows(uncertainty.stacked([verify.curves(study.usable(name)) for name in study.kinds]))


def front(study: Study, case_of: Callable) -> dict:
    """The front's designs; case_of: see page.report."""

    def walls_of(design):
        found = case_of(design)
        return None if found is None else hopper.walls_of(found)

    points = charts.front(study.front, list(study.keys), walls_of)
    return {"factors": list(study.words().values()), "points": points}


def infill(study: Study) -> dict:
    """The designs of the rounds of infill: as they were proposed, and what came of them."""
    rows = []
    for _, row in study.proposals.iterrows():
        found = [
            words
            for size in ("fine", "intermediate")
            for words in (
                answer.decimals(row[f"J_{size}"]),
                _interval(row, size, f"{size}_low", f"{size}_high", answer.decimals),
            )
        ]
        design = answer.design_words({name: row[name] for name in study.keys})
        number = row["experiment"].removeprefix("infill_").replace("_", ".")  # round.design
        rows.append((number, design, row["chosen_as"], *found))
    return {"proposals": rows}


def judged(study: Study) -> dict:
    """How far the surrogates and the selected design can be trusted."""
    return {
        "surrogates": facts.surrogates(study.validation, study.surrogate.attrs["surrogate"]),
        "verdicts": _verdicts(study.verdict),
        "warnings": facts.warnings(
            study.selected, (study.plan, study.infill, study.verification), study.undetectable
        ),
    }


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


def provenance(study: Study) -> dict:
    """By what and in what time the files were made."""
    runs = study.plan | study.infill | study.verification
    made = {
        "simulations": [run.attrs for run in runs.values()],
        "data set": [study.data.attrs],
        "surrogate": [study.surrogate.attrs],
    }
    return {
        "origins": facts.origins(made),
        "versions": facts.versions([attributes for group in made.values() for attributes in group]),
        "times": facts.run_times(_groups(study)),
        "runs": facts.all_runs(runs),
    }


def _groups(study: Study) -> dict[str, Runs]:
    """The runs by what they are for."""
    first = {"plan": study.plan} | ({"infill": study.infill} if study.infill else {})
    return first | {name.replace("_", " "): study.of_case(name) for name in study.kinds}
