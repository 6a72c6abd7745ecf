"""What a validation case returns, and the page made of it."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
STORE = DOCS / "validation"
HEAD = """# Validation of the solver

Each row was measured by `make validation`, which rewrites this page. `make validation CASE=name` reruns one
case. A case whose tool is missing keeps its last result.
"""


class Missing(Exception):
    """A case's tool is not on this machine; the sentence says how to get it."""


@dataclass
class Row:
    """One line of the table. `holds` says whether `obtained` lies within `tolerance` of `expected`.

    The texts hold numbers with units, as a reader would compare them; an empty tolerance marks a row that is
    reported and not judged.
    """

    test: str
    expected: str
    obtained: str
    tolerance: str
    holds: bool


def within(test, expected, obtained, tolerance, unit="", relative=False):
    """A row that compares two numbers; `tolerance` is a share of the expected value if `relative`."""
    allowed = tolerance * abs(expected) if relative else tolerance
    return Row(
        test,
        f"{expected:.5g} {unit}".strip(),
        f"{obtained:.5g} {unit}".strip(),
        f"{100 * tolerance:.3g} %" if relative else f"± {tolerance:.3g} {unit}".strip(),
        bool(abs(obtained - expected) <= allowed),
    )


def at_most(test, limit, obtained, unit=""):
    """A row that holds while a number is at most `limit`."""
    return Row(test, f"at most {limit:.4g} {unit}".strip(), f"{obtained:.4g} {unit}".strip(), "bound",
               bool(obtained <= limit))  # fmt: skip


def save_plain(figure, path):
    """Save a matplotlib figure with a faint grid and without frames around its axes, and close it."""
    import matplotlib.pyplot as plt

    for axes in figure.axes:
        axes.grid(color="0.93")
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def keep(name, title, text, rows, seconds, figures):
    """Store a case's result, for the page."""
    STORE.mkdir(parents=True, exist_ok=True)
    result = {
        "title": title,
        "text": text,
        "seconds": round(seconds, 1),
        "figures": figures,
        "rows": [asdict(row) for row in rows],
    }
    (STORE / f"{name}.json").write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n")


def write_page(names):
    """Write docs/validation.md from the stored results, in the order of `names`."""
    parts = [HEAD]
    for name in names:
        path = STORE / f"{name}.json"
        if not path.exists():
            continue
        case = json.loads(path.read_text())
        parts.append(f"## {case['title']}\n\n{case['text']}\n")
        parts.append("| test | expected | obtained | tolerance | holds |\n|---|---|---|---|---|")
        for row in case["rows"]:
            verdict = ("yes" if row["holds"] else "**no**") if row["tolerance"] else ""
            cells = (row["test"], row["expected"], row["obtained"], row["tolerance"], verdict)
            parts.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        parts.append("")
        parts += [f"![{case['title']}](validation/{figure})\n" for figure in case["figures"]]
        parts.append(f"Rerun: `make validation CASE={name}` ({case['seconds']:.0f} s).\n")
    (DOCS / "validation.md").write_text("\n".join(parts))
