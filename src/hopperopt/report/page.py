"""The stage `report`: one HTML file that holds everything that it shows and asks for nothing else."""

import base64
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import jinja2
from PIL import Image

from hopperopt import files
from hopperopt.figures import multiples, style
from hopperopt.report import charts, sections
from hopperopt.report.study import Study, read

TEMPLATES = Path(__file__).parent
WIDEST = 52.0  # rem, of a figure as wide as a page in print
# Figures of the study that the page shows, with what they show for who cannot see them.
ALTERNATIVES = {
    "indices": "Indices of segregation and flow of the plan's designs, the least segregating first.",
    "sensitivity": "Sobol' indices of the factors for each output.",
    "errors": "Errors of the surrogates, a line each; the numbers are in the table.",
    "fit": "Training targets and the network's curves in all experiments of the plan.",
    "front": "The predicted front, and the front among the simulated designs.",
    "verdict": "Predicted and simulated J of all cases with intervals; the numbers are in the table.",
    "verification": "Predicted and simulated outflow of the selected design.",
}


def report(
    params: Mapping,
    dataset: str | os.PathLike,
    effects: str | os.PathLike,
    validation: str | os.PathLike,
    comparison: str | os.PathLike,
    surrogate: str | os.PathLike,
    front: str | os.PathLike,
    selected: str | os.PathLike,
    verdict: str | os.PathLike,
    proposals: Iterable,
    designs: Iterable,
    simulations: Iterable,
    verification: Iterable,
    figures: Iterable[str | os.PathLike],
    output: str | os.PathLike,
) -> None:
    """Write report.html.

    params: `cases`, pairs of name and kind; `factors`, their names in order; `settings`, those of the stages,
    which are shown; `derived`, a dict with the factors' `keys`; `case_of`, a function of a design that
    returns its case, None where it cannot be built. The others are paths: dataset.nc, effects.csv,
    validation.csv, validation.nc, model.nc, front.csv, selected.yaml, verdict.csv, proposals.csv of each
    round of infill, designs.csv of the last one, the runs of plan and infill, the verification's runs, PNG
    files of figures.
    """
    tables = dataset, effects, validation, comparison, surrogate, front, selected, verdict
    study = read(params, *tables, proposals, designs, simulations, verification)
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
    shown = multiples.some(study.data)
    return environment.get_template("page.html").render(
        {
            **sections.opening(study),
            **sections.studied(study, settings),
            **sections.discharge(study),
            **sections.infill(study),
            **sections.judged(study),
            **sections.provenance(study),
            "colours": style.COLOURS,
            "shown_experiments": shown.sizes["experiment"],
            "figures": {name: _picture(path) for name, path in figures.items()},
            "alternatives": ALTERNATIVES,
            "data": {
                "curves": charts.curves(shown, list(study.keys)),
                "outflows": sections.outflows(study),
                "effects": charts.effects(study.effects, study.data, study.words(), study.selected["design"]),
                "front": sections.front(study, case_of),
            },
        }
    )


def _picture(path: str | os.PathLike) -> dict:
    """A PNG file as `source`, and its `width` (rem) on the page: all in one scale, that of print."""
    with Image.open(path) as image:
        width = image.width / image.info["dpi"][0] / style.MM
    source = f"data:image/png;base64,{base64.b64encode(Path(path).read_bytes()).decode()}"
    return {"source": source, "width": WIDEST * width / style.PAGE}
