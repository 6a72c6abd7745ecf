"""Run validation cases and rewrite docs/validation.md: `python -m validation [case ...]`.

A case is a module of this package with `measure(figures)`, which returns rows for the table and, when
`figures` is a directory, draws into it; its docstring's first line is the title, the rest the text. `QUICK`
cases take seconds and are held by `make test` as well.
"""

import argparse
import importlib
import sys
import time

from hopperopt.provenance import compile_solver
from validation import report

QUICK = ("chung_ooi", "impact", "friction", "invariance", "reference", "energy")
LONG = ("coarse_step", "bulk", "beverloo", "mutation")
PEER = ("liggghts_hopper", "liggghts_silo")
CASES = QUICK + LONG + PEER


def run(name):
    """Measure one case and store it. Returns whether all its rows hold; a skipped case does."""
    case = importlib.import_module(f"validation.{name}")
    title, _, text = case.__doc__.strip().partition("\n")
    begun = time.monotonic()
    report.STORE.mkdir(parents=True, exist_ok=True)
    before = {path: path.stat().st_mtime_ns for path in report.STORE.glob(f"{name}*.png")}
    try:
        rows = case.measure(report.STORE)
    except report.Missing as sentence:
        print(f"{name}: skipped. {sentence}")
        return True
    figures = sorted(path.name for path in report.STORE.glob(f"{name}*.png"))
    for path in before:
        if path.exists() and path.stat().st_mtime_ns == before[path]:
            path.unlink()  # no longer drawn
            figures.remove(path.name)
    report.keep(name, title.rstrip("."), text.strip(), rows, time.monotonic() - begun, figures)
    failed = [row for row in rows if row.tolerance and not row.holds]
    print(f"{name}: {len(rows)} rows, {len(failed)} fail ({time.monotonic() - begun:.0f} s)")
    for row in failed:
        print(f"  {row.test}: expected {row.expected}, obtained {row.obtained} ({row.tolerance})")
    return not failed


def main():
    """Run the named cases, or all; exit with 1 where a row does not hold."""
    parser = argparse.ArgumentParser(prog="python -m validation", description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="case", help=f"of {', '.join(CASES)}; all without")
    names = parser.parse_args().cases or CASES
    unknown = [name for name in names if name not in CASES]
    if unknown:
        parser.error(f"no such case: {', '.join(unknown)} (allowed: {', '.join(CASES)})")
    compile_solver()
    fine = [run(name) for name in names]
    report.write_page(CASES)
    sys.exit(0 if all(fine) else 1)


if __name__ == "__main__":
    main()
