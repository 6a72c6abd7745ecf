"""Rounds of infill: what they make of a finished study, and what reruns them (docs/reruns.md)."""

import pytest
import xarray as xr
import yaml

from hopperopt import files

pytestmark = pytest.mark.slow

ONCE = {"infill_filter", "infill_model", "infill_front"}  # of the round before
ROUND = {"propose", "infill_simulate", "infill_gather"}
BATCH = 2


def with_infill(study, rounds, **changes):
    """Write other.yaml, and return the options that read it."""
    changes = {"infill": {"rounds": rounds, "batch": BATCH}} | changes
    (study.directory / "other.yaml").write_text(yaml.safe_dump(changes))
    return "--configfile", "other.yaml"


def planned(study, *options):
    """Outputs of the jobs of infill that a dry run plans, by rule, and the names of the other rules."""
    ours, others = {}, set()
    for rule, outputs in study.jobs(*options):
        if rule in ONCE | ROUND:
            ours.setdefault(rule, []).append(outputs[0].removeprefix("results/infill/"))
        else:
            others.add(rule)
    return {rule: sorted(paths) for rule, paths in ours.items()}, others


def test_a_round_reruns_nothing_of_the_plan(study):
    rounds, others = planned(study, *with_infill(study, 1))
    assert set(rounds) == ONCE | ROUND
    assert rounds["propose"] == ["round_1/proposals.csv"] and rounds["infill_model"] == ["round_0/model.nc"]
    runs = [f"round_1/infill_1_{place}_rep_1.nc" for place in range(1, BATCH + 1)]
    assert rounds["infill_simulate"] == runs
    assert {"filter", "validate_fold", "optimise", "sensitivity", "figure_front"} <= others
    assert not others & {"design", "simulate", "gather", "effects", "figure_curves", "figure_effects"}


@pytest.mark.full
def test_what_reruns_rounds(study):
    assert study.ask("--touch", "--forceall").returncode == 0
    options = with_infill(study, 2)
    pretend(study, options)
    assert planned(study, *options) == ({}, set())
    more, _ = planned(study, *with_infill(study, 3))
    assert more["propose"] == ["round_3/proposals.csv"] and more["infill_model"] == ["round_2/model.nc"]
    assert {path[:7] for path in more["infill_simulate"]} == {"round_3"}
    fewer, others = planned(study, *with_infill(study, 1))
    assert fewer == {} and "filter" in others
    for change in (
        {"surrogate": {"clip_sigma": 2, "hidden_nodes": [2, 4]}},
        {"optimise": {"select": "compromise"}},
        {"verification": {"replicates": 2}, "figures": {"dpi": 60}},
    ):
        assert planned(study, *with_infill(study, 2, **change))[0] == {}, change
    wider = yaml.safe_load((study.clone / "config.yaml").read_text())["factors"]
    wider["height_mm"]["levels"][-1] = 25
    for change in (
        {"optimise": {"population": 10}},
        {"surrogate": {"seed": 2}},
        {"infill": {"rounds": 2, "batch": 1}},
        {"factors": wider},
    ):
        rounds, others = planned(study, *with_infill(study, 2, **change))
        assert len(rounds["propose"]) == 2 and "simulate" not in others, change
    study.add_code("infill.py", "\nEXTRA = 1\n")
    assert planned(study, *with_infill(study, 2))[0]["propose"] == [
        f"round_{n}/proposals.csv" for n in (1, 2)
    ]


def pretend(study, options):
    """Make the files of the rounds without computing anything."""
    for _, outputs in study.jobs(*options):
        for path in outputs:
            (study.directory / path).parent.mkdir(parents=True, exist_ok=True)
            (study.directory / path).touch()
    assert study.ask("--touch", "--forceall", *options).returncode == 0


@pytest.mark.full
def test_rounds_are_simulated_and_enter_the_surrogate(study):
    plan = (study.directory / "results" / "dataset.nc").read_bytes()
    answer = study.snakemake(*with_infill(study, 2))
    assert answer.returncode == 0, answer.stdout
    results = study.directory / "results"
    assert (results / "dataset.nc").read_bytes() == plan
    proposed = [f"infill_{number}_{place}" for number in (1, 2) for place in (1, 2)]
    names = [f"exp_0{number}" for number in range(1, 6)] + proposed
    for path in ("infill/round_2/dataset.nc", "surrogate/training.nc", "surrogate/validation.nc"):
        with xr.open_dataset(results / path) as data:
            assert list(data["experiment"].values) == names, path
    with xr.open_dataset(results / "infill" / "round_2" / "dataset.nc") as data:
        for number in (1, 2):
            table = files.read_table(results / "infill" / f"round_{number}" / "proposals.csv", "experiment")
            for _, row in table.iterrows():
                simulated = data.sel(experiment=row["experiment"])
                assert [float(simulated[name]) for name in ("theta_deg", "length_mm", "height_mm")] == [
                    row[name] for name in ("theta_deg", "length_mm", "height_mm")
                ]
        assert data["mass_fraction"].notnull().all()
        assert len(set(data["J"].isel(size_class=0).values.ravel())) > len(proposed)
    assert study.planned(*with_infill(study, 2)) == set()
