"""What runs again after a change: what the tables of docs/reruns.md say, which are read here.

A row's first cell names the change, the others what reruns. Each row is a dry run or more; most are marked
`full` for that.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from fnmatch import fnmatch

import pytest
import yaml

from hopperopt import cli, config, document, provenance

pytestmark = pytest.mark.slow

PAGE = provenance.PACKAGE.parents[1] / "docs" / "reruns.md"
CASES = ["selected", "best_f", "plan_best", "plan_centre", "bare"]
SIMULATIONS = ("simulate", "verify_simulate")
EXTRA = "\nEXTRA = 1\n"  # code


def read_tables():
    """The page's tables by the head of their first column: {first cell: {column: cell}}."""
    tables, columns = {}, []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        first, *cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[:1] == ["design"]:
            columns, rows = cells, tables.setdefault(first, {})
        elif not cells:  # the table is over
            columns = []
        elif columns and not first.startswith("-"):
            assert first not in rows, f"two rows are called {first}"
            rows[first] = dict(zip(columns, cells, strict=True))
    return tables


TABLES = read_tables()


def names_in(first):
    """What stands in backticks in a row's first cell."""
    return re.findall(r"`([^`]+)`", first)


def jobs(row):
    """The jobs of a row as `Study.planned` names them, in the tiny study of five experiments."""
    everything = {
        "simulate": [f"exp_0{number}" for number in range(1, 6)],
        "verify_simulate": CASES,
        "figures": list(cli.FIGURES),
    }
    found = set()
    for column, cell in row.items():
        names = everything.get(column, []) if cell in ("all", "rep_2") else cell.split()
        if column == "figures":
            found |= {name if name == "report" else f"figure_{name}" for name in names}
        elif column in everything:
            found |= {f"{column} {name}_{'rep_2' if cell == 'rep_2' else 'rep_1'}" for name in names}
        elif cell == "●":
            found.add(column)
    # The report has no column: it is made of all but these.
    return found | {"report"} if found - {"figure_hopper", "figure_curves", "figure_effects"} else found


def test_cells_hold_nothing_else():
    """A misspelt cell would be a rerun that no other test could see."""
    figure = "|".join([*cli.FIGURES, "report"])
    runs = r"all|rep_2|exp_0\d|5|10|(selected( best_f)?( plan_best)?|bare|other)( plan_centre)?"
    allowed = {"simulate": runs, "verify_simulate": runs, "figures": rf"all|(({figure})\b ?)+"}
    for first, row in [item for table in TABLES.values() for item in table.items()]:
        for column, cell in row.items():
            assert re.fullmatch(f"{allowed.get(column, '●')}|", cell), (first, column, cell)


def fast_are(fast, names):
    """Parameters of a test, all but the fast ones left to the full counts."""
    assert set(fast) <= set(names)
    return [name if name in fast else pytest.param(name, marks=pytest.mark.full) for name in names]


# A rule itself.

# Without those of infill, which this study has none of; see below.
STAGES = {name: stage for name, stage in cli.STAGES.items() if name != "propose"}
RULES = [*STAGES, "simulate", "verify_simulate", *(f"figure_{name}" for name in cli.FIGURES)]


@pytest.mark.parametrize("rule", fast_are(["train"], RULES))
def test_forced_rule(study, rule):
    assert study.planned("--forcerun", rule) == jobs(TABLES["rule"][f"`{rule}`"])


def test_every_rule_has_a_row():
    assert sorted(TABLES["rule"]) == sorted(f"`{rule}`" for rule in RULES)


@pytest.mark.full
def test_a_deleted_file_is_made_again_as_if_its_rule_was_forced(study):
    """Every file but the simulations', of which only that run is repeated (see below)."""
    for rule, outputs in study.jobs("--forceall"):
        for path in [study.directory / output for output in outputs if rule not in SIMULATIONS]:
            aside = path.rename(path.with_suffix(".aside"))
            assert study.planned() == jobs(TABLES["rule"][f"`{rule}`"]), path
            aside.rename(path)


# Keys of the configuration.

# Another value of every key; those of the plan, the insert and the factors are below.
OTHER = {
    "results_dir": "elsewhere",
    "seed": 2,
    "hopper.outlet_radius_mm": 23,
    "hopper.half_angle_deg": 44,
    "hopper.cylinder_radius_mm": 51,
    "particles.diameters_mm": [2, 3, 3.9],
    "particles.density_kg_m3": 2300,
    "particles.shear_modulus_pa": 9e6,
    "particles.poisson_ratio": 0.3,
    "wall.shear_modulus_pa": float("inf"),
    "wall.poisson_ratio": 0.3,
    "contact.rolling": "cdt",
    "contact.particle.static_friction": 0.4,
    "contact.particle.rolling_friction": 0.1,
    "contact.particle.restitution": 0.6,
    "contact.wall.static_friction": 0.4,
    "contact.wall.rolling_friction": 0.1,
    "contact.wall.restitution": 0.3,
    "filling.level_mm": 73,
    "filling.particles": 63,
    "filling.bed_solid_fraction": 0.56,
    "filling.column_solid_fraction": 0.19,
    "filling.speed_m_s": 0.6,
    "filling.speed_scatter_m_s": 0.06,
    "filling.settling_limit_s": 1.6,
    "discharge.sensor_mm": -13,
    "discharge.idle_limit_s": 0.6,
    "discharge.time_limit_s": 11,
    "discharge.incomplete": "drop",
    "simulation.time_step_s": "auto",
    "simulation.gravity_m_s2": 9.8,
    "simulation.threads": 2,
    "simulation.checkpoint_minutes": 7,
    "simulation.snapshot_interval_s": 0.02,
    "design.replicates": 2,
    "design.lhs.experiments": 5,
    "design.lhs.seed": 2,
    "design.sobol.experiments": 8,
    "design.sobol.seed": 2,
    "design.csv.file": "same.csv",
    "infill.batch": 2,
    "surrogate.clip_sigma": None,
    "surrogate.hidden_nodes": [2, 4],
    "surrogate.starts": 3,
    "surrogate.selected_hidden_nodes": 3,
    "surrogate.split": "points",
    "surrogate.validation_experiments": 2,
    "surrogate.test_experiments": 2,
    "surrogate.validation.starts": 2,
    "surrogate.model": "gaussian",
    "surrogate.seed": 2,
    "optimise.population": 10,
    "optimise.generations": 4,
    "optimise.crossover_probability": 0.8,
    "optimise.mutation_probability": 0.2,
    "optimise.seed": 2,
    "optimise.seeds": 2,
    "optimise.select": "compromise",
    "optimise.explicit": {"theta_deg": 55, "length_mm": 40, "height_mm": 30},
    "verification.replicates": 2,
    "figures.dpi": 60,
}
FAST_KEYS = ["wall.poisson_ratio", "simulation.threads", "surrogate.selected_hidden_nodes", "figures.dpi"]


def row_of(key):
    """The row that names a key, or else the part above it."""
    named = {name: row for first, row in TABLES["key"].items() for name in names_in(first)}
    while key not in named:
        key = key[: key.rindex(".")]
    return named[key]


@pytest.mark.parametrize("key", fast_are(FAST_KEYS, OTHER))
def test_key(study, key):
    override(study, key, OTHER[key])
    shutil.copy(study.directory / "plan.csv", study.directory / "same.csv")
    assert study.planned("--configfile", "other.yaml") == jobs(row_of(key))


def override(study, key, value):
    """Write other.yaml with a value at a dotted key."""
    for part in reversed(key.split(".")):
        value = {part: value}
    (study.directory / "other.yaml").write_text(yaml.safe_dump(value))


AT_THEIR_OWN = ("infill.rounds", "insert.", "factors.", "verification.cases.", "verification.replicates_of.")


def test_every_key_has_another_value():
    known = {re.sub(r"\.\d+$", "", key) for key in document.dotted_keys(config.parse({}).document)}
    elsewhere = {key for key in known if key.startswith(AT_THEIR_OWN)}
    assert known - elsewhere <= {*OTHER, "design.plan"}
    assert {row["simulate"] for row in map(row_of, OTHER)} == {"all", "rep_2", ""}


@pytest.mark.full
def test_the_code_of_snapshots_counts_where_they_are_taken(study):
    override(study, "simulation.snapshot_interval_s", 0.1)
    assert study.ask("--touch", "--forceall", "--configfile", "other.yaml").returncode == 0
    assert study.planned("--configfile", "other.yaml") == set()
    study.add_code("snapshots.py", EXTRA)
    assert study.planned("--configfile", "other.yaml") == jobs(row_of("hopper"))


@pytest.mark.full
def test_more_runs_of_one_case_are_all_that_runs(study):
    override(study, "verification.replicates_of.bare", 2)
    planned = study.planned("--configfile", "other.yaml")
    after = {"verify", "figure_verdict", "figure_front", "report"}
    assert planned == {"verify_simulate bare_rep_2"} | after


# The code.

MODULES = sorted(
    str(path.relative_to(provenance.PACKAGE))
    for path in provenance.PACKAGE.rglob("*.py")
    if path.name != "__init__.py"
)
CODE_OF = {
    **{name: stage.module for name, stage in STAGES.items()},
    **dict.fromkeys(("simulate", "verify_simulate"), cli.SIMULATION),
    **{f"figure_{name}": f"figures.{name}" for name in cli.FIGURES},
}


def code_row(module):
    """The one row that names a module."""
    rows = [
        row
        for first, row in TABLES["module"].items()
        if any(fnmatch(module, pattern) for pattern in names_in(first))
    ]
    assert len(rows) == 1, f"{module} is in {len(rows)} rows of {PAGE.name}"
    return rows[0]


def test_code_changes_the_digests_of_its_rows_rules(tmp_path):
    """All modules: the rules whose digest an edit changes, and what follows from these, are the row's."""
    package = shutil.copytree(provenance.PACKAGE, tmp_path / "hopperopt")

    def digests():
        return {
            (rule, provenance.code_digest(f"hopperopt.{name}", package=package))
            for rule, name in CODE_OF.items()
        }

    before = digests()
    for module in MODULES:
        text = (package / module).read_text(encoding="utf-8")
        (package / module).write_text(text + EXTRA, encoding="utf-8")
        changed = {rule for rule, _ in digests() - before}
        (package / module).write_text(text, encoding="utf-8")
        follow = [jobs(TABLES["rule"][f"`{rule}`"]) for rule in changed]
        assert jobs(code_row(module)) == set().union(*follow), module


@pytest.mark.parametrize("module", fast_are(["dem/laws.py"], MODULES))
def test_code(study, module):
    study.add_code(module, EXTRA)
    assert study.planned() == jobs(code_row(module))


@pytest.mark.full
@pytest.mark.parametrize("name", ["page.html", "style.css", "charts.js", "front.js"])
def test_another_page_is_the_reports_alone(study, name):
    study.add_code(f"report/{name}", "\n")
    assert study.planned() == {"report"}


@pytest.mark.full
def test_code_that_makes_other_cases_reruns_the_simulations(study):
    study.edit_code("src/hopperopt/case.py", "HEADROOM = 0.020", "HEADROOM = 0.030")
    assert study.planned() == jobs(row_of("hopper"))


# Every other change: a function of the study, registered under its row, that returns what is planned.

CHANGES = []


def change(first, *marks):
    """Register a function as the change that a row's first cell names."""

    def register(function):
        CHANGES.append(pytest.param(first, function, id=function.__name__, marks=marks))
        return function

    return register


FULL = pytest.mark.full
FACTORS = """
factors:
  theta_deg: {key: insert.cone.slope_deg, levels: [60, 57.5, 55, 52.5, 50]}
  length_mm: {key: insert.cone.length_mm, levels: [50, 45, 40, 35, 30]}
  height_mm: {key: insert.height_mm, levels: [34, 32, 29.6, 28, 26]}
"""


def with_factors(study, old, new):
    """What is planned with the factors, the text `old` of them replaced."""
    (study.directory / "other.yaml").write_text(FACTORS.replace(old, new, 1))
    return study.planned("--configfile", "other.yaml")


@change("the design of an experiment in a plan of your own", FULL)
def experiment_changed(study):
    study.edit("plan.csv", "exp_05,55,40,29.6", "exp_05,55,40,30")
    return study.planned()


@change("an experiment more in a plan of your own")
def experiment_more(study):
    study.edit("plan.csv", "exp_05,55,40,29.6", "exp_05,55,40,29.6\nexp_06,55,40,30")
    return study.planned()


@change("an experiment less in a plan of your own; its runs stay on the disk", FULL)
def experiment_less(study):
    study.edit("plan.csv", "exp_05,55,40,29.6\n", "")
    return study.planned()


@change("another `design.plan` with as many experiments", FULL)
def plan_changed(study):
    study.edit("config.yaml", "plan: csv", "plan: lhs, lhs: {experiments: 5}")
    study.edit("config.yaml", "surrogate:", "surrogate:\n  split: points")  # of five, none can be spared
    return study.planned()


@change("an end of a range, plan of your own", FULL)
def range_changed(study):
    return with_factors(study, "50]", "49]")


@change("the middle level, plan of your own", FULL)
def middle_level_changed(study):
    return with_factors(study, "55", "56")


@change("a level between the others, plan of your own", FULL)
def inner_level_changed(study):
    return with_factors(study, "52.5", "53")


@change("a factor's `key`", FULL)
def key_changed(study):
    return with_factors(study, "insert.height_mm", "filling.level_mm")


@change("a case more", FULL)
def case_more(study):
    other = "other: {theta_deg: 57, length_mm: 32, height_mm: 33}"
    study.edit("config.yaml", "bare: bare", f"bare: bare, {other}")
    return study.planned()


@change("a case less; its runs stay on the disk", FULL)
def case_less(study):
    study.edit("config.yaml", ", bare: bare", "")
    return study.planned()


@change("none; the study copied or moved to another folder", FULL)
def moved(study):
    study.directory = study.directory.rename(study.directory.with_name("moved here"))
    return study.planned()


@change("comments, docstrings, layout of the code")
def comments_changed(study):
    study.add_code("dem/laws.py", "\n# A comment.\n")
    study.add_code("experiment.py", '\n"""More words."""\n')
    study.edit_code("src/hopperopt/select.py", "(objectives / np.asarray(", "( objectives/np.asarray(")
    return study.planned()


@change("the command of a rule, here `optimise`", FULL)
def command_changed(study):
    study.edit_code("workflow/rules/optimise.smk", "--surrogate ", "--surrogate  ")
    return study.planned()


@change("`threads`, `resources` and comments of rules", FULL)
def rule_changed(study):
    study.edit_code("workflow/rules/optimise.smk", "threads: 1", "threads: 2  # cores")
    study.edit_code("workflow/rules/optimise.smk", "runtime=15", "runtime=20")
    return study.planned()


@change("another number of cores", FULL)
def cores_changed(study):
    return study.planned("--cores", "1")


@change("newer libraries", FULL)
def libraries_changed(study):
    study.add_code("outflow.py", "")
    newer = study.clone / "src" / "numpy-99.0.dist-info"
    newer.mkdir()
    (newer / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 99.0\n")
    program = "from hopperopt import provenance; print(provenance.attributes()['versions'])"
    told = subprocess.check_output([sys.executable, "-c", program], env=study.environment, text=True)
    assert '"numpy": "99.0"' in told
    return study.planned()


# From the last to the first in the study: each file gets a later date than those that are made from it.
CHAIN = """
    figures/front.png verification/verdict.csv optimum/selected.yaml surrogate/network.nc
    surrogate/training.nc dataset.nc design.csv simulations/exp_05_rep_1.nc ../plan.csv ../config.yaml
"""


def touch(study, names):
    """Give files of the results new dates, each later than the one before."""
    for later, name in enumerate(names, start=1):
        os.utime(study.directory / "results" / name, times=(time.time() + later,) * 2)


@change("a newer date of files below 1 MB")
def dates_changed(study):
    touch(study, CHAIN.split())
    return study.planned()


@change("a newer date of a file above 1 MB, here a run of the plan", FULL)
def date_of_a_large_file_changed(study):
    touch(study, ["simulations/exp_05_rep_1.nc"])
    return study.planned("--max-checksum-file-size", "1")


@change("the content of a file by hand, here `design.csv`", FULL)
def content_changed(study):
    study.edit("results/design.csv", "exp_05,55", "exp_05,56")
    touch(study, ["design.csv"])
    return study.planned()


@change("a file deleted, here a run of the plan")
def run_deleted(study):
    (study.directory / "results" / "simulations" / "exp_05_rep_1.nc").unlink()
    return study.planned()


@change("a file deleted, here the run of `selected`", FULL)
def run_of_the_selected_design_deleted(study):
    (study.directory / "results" / "verification" / "selected_rep_1.nc").unlink()
    return study.planned()


@change("a file deleted, here the run of `bare`", FULL)
def run_of_the_bare_hopper_deleted(study):
    (study.directory / "results" / "verification" / "bare_rep_1.nc").unlink()
    return study.planned()


@change("logs deleted", FULL)
def logs_deleted(study):
    shutil.rmtree(study.directory / "results" / "logs")
    return study.planned()


@change("`.snakemake/` deleted", FULL)
def records_deleted(study):
    shutil.rmtree(study.directory / ".snakemake")
    assert "missing provenance/metadata" in study.ask("--dry-run").stdout
    return study.planned()


@pytest.mark.parametrize(("first", "made"), CHANGES)
def test_change(study, first, made):
    assert made(study) == jobs(TABLES["change"][first])


# Changes of studies with another plan or insert, of which nothing has been computed.


@pytest.fixture(scope="module")
def l25(tmp_path_factory, new_study, finished):
    """The tiny study with the orthogonal array, taken for done."""
    text = (finished.directory / "config.yaml").read_text().replace("plan: csv", "plan: l25")
    study = new_study(tmp_path_factory.mktemp("l25"), text)
    study.pretend()
    return study


LEVELS = {
    "a level between the others of the orthogonal array: the 5 experiments of that level": ("52.5", "53"),
    "both ends of a range, orthogonal array: the 5 experiments of each": (
        "[50, 45, 40, 35, 30]",
        "[51, 45, 40, 35, 29]",
    ),
    "the middle level, orthogonal array": ("29.6", "30"),
}


@pytest.mark.full
@pytest.mark.parametrize("first", LEVELS)
def test_level_of_the_orthogonal_array(l25, first):
    """The rows give the number of experiments; which ones is known from the plans before and after."""
    old, new = LEVELS[first]
    plans = [
        dict(config.parse(yaml.safe_load(text)).experiments())
        for text in (FACTORS, FACTORS.replace(old, new, 1))
    ]
    changed = {f"simulate {name}_rep_1" for name in plans[0] if plans[0][name] != plans[1][name]}
    row = TABLES["change"][first]
    assert len(changed) == int(row["simulate"])
    assert with_factors(l25, old, new) == jobs(row | {"simulate": ""}) | changed


BODY = "r_mm,z_mm\n0,0\n10,0\n10,5\n0,20\n"
INSERT = {
    "the insert's `shape`, or a key or the CSV file of the shape that it picks": [
        ("insert.shape", "cone"),
        ("insert.profile.file", "slim.csv"),
    ],
    "a key of `insert` that a factor varies, or of a shape that is not picked": [
        ("insert.height_mm", 31),
        ("insert.cone.slope_deg", 56),
        ("insert.cone.length_mm", 41),
    ],
}


@pytest.fixture(scope="module")
def profiled(tmp_path_factory, new_study, finished):
    """The tiny study with an insert from a CSV file, varied in its height, taken for done."""
    text = (finished.directory / "config.yaml").read_text() + (
        "insert: {shape: profile, profile: {file: body.csv}}\n"
        "factors: {height_mm: {key: insert.height_mm, levels: [34, 32, 30, 28, 26]}}\n"
    )
    tables = {
        "plan": "experiment,height_mm\nexp_01,34\nexp_02,26\nexp_03,34\nexp_04,26\nexp_05,30\n",
        "body": BODY,
        "slim": BODY.replace("10", "9"),
    }
    study = new_study(tmp_path_factory.mktemp("profiled"), text, **tables)
    study.pretend()
    return study


@pytest.mark.full
@pytest.mark.parametrize(("first", "key", "value"), [(row, *pair) for row in INSERT for pair in INSERT[row]])
def test_insert(profiled, first, key, value):
    override(profiled, key, value)
    assert profiled.planned("--configfile", "other.yaml") == jobs(TABLES["change"][first])


def test_every_change_of_the_page_is_tested():
    tested = [parameters.values[0] for parameters in CHANGES]
    assert sorted(TABLES["change"]) == sorted([*tested, *LEVELS, *INSERT])


# What the page tells beside its tables.


@pytest.mark.full
def test_results_are_accepted_after_an_edit_by_touch_or_by_dates(study):
    study.add_code("dem/laws.py", EXTRA)
    assert study.planned("--rerun-triggers", "mtime") == set()
    assert study.ask("--touch").returncode == 0
    assert study.planned() == set()
    before_the_edit = type(study)(study.directory)
    assert before_the_edit.planned() == jobs(code_row("dem/laws.py"))


@pytest.mark.full
def test_everything_runs_again_by_force(study):
    assert study.planned("--forceall") == jobs(row_of("results_dir"))


@pytest.mark.full
def test_a_file_as_the_target_runs_what_it_needs(study):
    shutil.rmtree(study.directory / "results")
    others = ("figure", "verify", "effects", "sensitivity", "report")
    needed = {job for job in jobs(row_of("results_dir")) if not job.startswith(others)}
    assert study.planned("results/optimum/selected.yaml") == needed
