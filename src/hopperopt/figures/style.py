"""What all figures share: sizes in print, colours, words, and files that are the same every time."""

import os
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import matplotlib.style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from hopperopt import files, units

MM = 1 / 25.4  # inches
COLUMN, PAGE = 85.0, 175.0  # widths in print, mm
IMAGE_DPI = 400  # of images inside a PDF

# Colours of Okabe and Ito, which colour-blind readers tell apart; the coarse particles stay behind in grey.
COLOURS = {"fine": "#D55E00", "intermediate": "#0072B2", "coarse": "#8C8C8C"}
SYMBOLS = {"fine": r"$m_\mathrm{f}$", "intermediate": r"$m_\mathrm{i}$", "coarse": r"$m_\mathrm{c}$"}
OBJECTIVES = {"fine": r"$J_\mathrm{f}$, fine", "intermediate": r"$J_\mathrm{i}$, intermediate"}
INK, FAINT = "#333333", "#B0B0B0"
DISCHARGED = "discharged mass fraction $M$"

HALO = [withStroke(linewidth=1.8, foreground="white")]  # keeps words legible upon lines and particles

FACTORS = {"theta": r"$\theta$", "length": "$L$", "height": "$H$"}

styled: Callable = matplotlib.style.context(
    [
        "default",  # nothing is left to a user's own settings of matplotlib
        {
            "font.family": "DejaVu Sans",  # comes with matplotlib: the same on every machine
            "font.size": 7,
            "axes.labelsize": 7,
            "axes.titlesize": 7,
            "xtick.labelsize": 7,
            "ytick.labelsize": 7,
            "axes.linewidth": 0.5,
            "axes.edgecolor": INK,
            "axes.labelcolor": INK,
            "text.color": INK,
            "xtick.color": INK,
            "ytick.color": INK,
            "axes.titlepad": 3,
            "axes.labelpad": 2.5,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "xtick.major.width": 0.5,
            "ytick.major.width": 0.5,
            "xtick.major.size": 2,
            "ytick.major.size": 2,
            "xtick.major.pad": 2,
            "ytick.major.pad": 2,
            "lines.linewidth": 1.0,
            "lines.markersize": 3,
            "lines.markeredgewidth": 0.7,
            "mathtext.fontset": "dejavusans",
            "pdf.fonttype": 42,
            "savefig.facecolor": "white",
        },
    ]
)  # decorates the functions that draw or save


class Frame(NamedTuple):
    """Margins between a figure's edges and its panels, mm."""

    left: float
    right: float
    bottom: float
    top: float


def page(width: float, height: float) -> Figure:
    """Empty figure of a size in mm."""
    figure = Figure(figsize=(width * MM, height * MM))
    FigureCanvasAgg(figure)
    return figure


def panels(figure: Figure, rows: int, columns: int, frame: Frame, gaps: tuple[float, float], **options):
    """Array (rows, columns) of axes of one size; gaps between columns and between rows in mm."""
    width, height = size(figure)
    wide = (width - frame.left - frame.right - (columns - 1) * gaps[0]) / columns
    high = (height - frame.bottom - frame.top - (rows - 1) * gaps[1]) / rows
    return figure.subplots(
        rows,
        columns,
        squeeze=False,
        gridspec_kw={
            "left": frame.left / width,
            "right": 1 - frame.right / width,
            "bottom": frame.bottom / height,
            "top": 1 - frame.top / height,
            "wspace": gaps[0] / wide,
            "hspace": gaps[1] / high,
        },
        **options,
    )


def size(figure: Figure) -> tuple[float, float]:
    """Width and height of a figure in mm."""
    return tuple(figure.get_size_inches() / MM)


def put(figure: Figure, x: float, y: float, text: str, **options) -> Text:
    """Write a text at x and y in mm from the figure's left lower corner."""
    width, height = size(figure)
    return figure.text(x / width, y / height, text, **options)


def key(figure: Figure, meanings: Mapping[str, Mapping], corner: tuple[float, float]) -> Legend:
    """Write what lines and marks mean {text: their properties} in one row.

    corner: x and y in mm of its left upper corner, from the figure's left lower corner.
    """
    lines = [Line2D([], [], **{"color": INK, **properties}) for properties in meanings.values()]
    width, height = size(figure)
    return figure.legend(
        lines,
        list(meanings),
        loc="upper left",
        bbox_to_anchor=(corner[0] / width, corner[1] / height),
        ncols=len(lines),
        frameon=False,
        borderpad=0,
        borderaxespad=0,
        handlelength=1.8,
        handletextpad=0.5,
        columnspacing=1.3,
    )


@styled
def save(figure: Figure, outputs: Iterable[str | os.PathLike], dpi: int) -> None:
    """Write a figure to each of the paths, PNG or PDF by its suffix; neither holds a date or a version."""
    for path in outputs:
        pdf = str(path).endswith(".pdf")
        silent = ("Creator", "Producer", "CreationDate") if pdf else ("Software",)
        with files.atomic(path) as temporary:
            figure.savefig(temporary, dpi=IMAGE_DPI if pdf else dpi, metadata=dict.fromkeys(silent))


def factor_parts(name: str) -> tuple[str, str]:
    """Symbol and unit of a factor: theta_deg gives (θ, °), outlet_radius_mm (outlet radius, mm)."""
    stem, unit = units.split(name)
    return FACTORS.get(stem, stem.replace("_", " ")), unit.words


def design_text(design: Mapping[str, float]) -> str:
    """A design in words: θ = 55°, L = 40 mm, ..., the paper's factors first; `no insert` for an empty one."""
    stems = list(FACTORS)
    names = sorted(
        design,
        key=lambda name: stems.index(stem) if (stem := name.rpartition("_")[0]) in stems else len(stems),
    )
    parts = [(*factor_parts(name), design[name]) for name in names]
    return ", ".join(f"{symbol} = {value:.3g}{unit}" for symbol, unit, value in parts) or "no insert"
