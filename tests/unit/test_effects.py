"""Main effects and the analysis of variance, on plans whose effects and noise are known."""

import itertools

import numpy as np
import pytest
import xarray as xr

from hopperopt import design, effects, files

LEVELS = {
    "theta_deg": [60, 57.5, 55, 52.5, 50],
    "length_mm": [50, 45, 40, 35, 30],
    "friction": [5, 4, 3, 2, 1],
}
L25 = np.array([list(experiment.design.values()) for experiment in design.l25(LEVELS)])
ALMOST = L25 - np.where(L25[:, 2:] == 3, [0, 0, 0.1], 0)  # the middle level beside the others' mean
LHS = np.array([list(experiment.design.values()) for experiment in design.lhs(LEVELS, 24, 1)])
CUBE = np.array(list(itertools.product([50, 55, 60], [30, 40, 50], [1, 2, 3])), dtype=float)


def plan(designs, fine, intermediate=None, variance=1e-10, runs=3):
    """A data set of a plan as `gather` writes it, as far as it matters here."""
    U = np.column_stack([fine, fine if intermediate is None else intermediate])
    dimensions = ("experiment", "size_class")
    return xr.Dataset(
        {
            "U_design": (dimensions, U),
            "U_design_variance": (dimensions, np.full(U.shape, variance)),
            "runs": ("experiment", np.broadcast_to(runs, len(U))),
        },
        coords={
            "size_class": ["fine", "intermediate"],
            "experiment": [f"exp_{number:02d}" for number in range(1, len(U) + 1)],
            **{name: ("experiment", values) for name, values in zip(LEVELS, designs.T, strict=True)},
        },
    )


def anova(data):
    """The table by objective and source."""
    table = effects.analysis_of_variance(data, list(LEVELS))
    return table.set_index(["objective", "source"])


def test_effects_are_means_of_the_squares_at_each_level():
    theta, _, friction = L25.T
    square = 1e-4 + 2e-6 * (theta - 55) + 1e-5 * (friction - 3)
    table = effects.main_effects(plan(L25, square, -square, variance=4e-10), list(LEVELS))
    table = table.set_index(["factor", "objective", "level"]).sort_index()
    expected = np.sqrt(1e-4 + 2e-6 * np.arange(-5, 6, 2.5))
    np.testing.assert_allclose(table.loc[("theta_deg", "fine"), "J"], expected)
    np.testing.assert_allclose(table.loc[("theta_deg", "intermediate"), "J"], -expected)
    np.testing.assert_allclose(table.loc[("length_mm", "fine"), "J"], 1e-2)
    half = 1.6448536 * 2e-5 / np.sqrt(5)
    low, high = (table.loc[("length_mm", "fine"), end] for end in ("J_low", "J_high"))
    np.testing.assert_allclose(low, np.sqrt(1e-4 - half))
    np.testing.assert_allclose(high, np.sqrt(1e-4 + half))


def test_effects_name_the_experiments_whose_mean_they_are(caplog):
    for designs in (L25, LHS):
        data = plan(designs, designs[:, 0] * 1e-6)
        for _, row in effects.main_effects(data, list(LEVELS)).iterrows():
            own = data.sel(experiment=row["experiments"].split())
            assert own[row["factor"]].mean() == pytest.approx(row["level"])
            assert own["U_design"].sel(size_class="fine").mean() == pytest.approx(row["J"] ** 2)
            assert (own[row["factor"]] == row["level"]).all() or designs is LHS


def test_where_levels_are_not_repeated_bins_of_equal_count_stand_for_them(caplog):
    caplog.set_level("INFO")
    table = effects.main_effects(plan(LHS, LHS[:, 0] * 1e-6), list(LEVELS))
    rows = table[(table["factor"] == "theta_deg") & (table["objective"] == "fine")]
    assert len(rows) == 5 and rows["level"].is_monotonic_increasing
    np.testing.assert_allclose(rows["J"], np.sqrt(rows["level"] * 1e-6))
    assert "theta_deg: its levels are not repeated, effects are of 5 bins of designs" in caplog.text


def test_the_sources_add_up_and_a_term_has_what_it_explains():
    rng = np.random.default_rng(1)
    length = L25[:, 1] - 40
    table = anova(plan(L25, 3e-6 * length**2, rng.normal(0, 1e-5, 25)))
    squares = table["sum_of_squares"].unstack("source")
    np.testing.assert_allclose(squares.drop(columns=["designs", "noise"]).sum(axis=1), squares["designs"])
    assert squares.loc["fine", "length_mm^2"] == pytest.approx(squares.loc["fine", "designs"])
    assert table.loc["fine", "df"].dropna().tolist() == [24, *[1] * 6, 18, 50]
    # Also where terms are not at right angles, they leave nothing of what they make up.
    skewed = anova(plan(LHS, 3e-6 * (LHS[:, 0] - 50) ** 2 + 1e-5 * LHS[:, 2])).loc["fine", "sum_of_squares"]
    assert skewed["residual"] / skewed["designs"] == pytest.approx(0, abs=1e-9)
    # Of another scale and origin, the factors have the same analysis.
    other = anova(plan(L25 * [2, 1, 1] + [0, 7, 0], 3e-6 * length**2))
    np.testing.assert_allclose(
        other.loc["fine", "sum_of_squares"], squares.loc["fine", other.loc["fine"].index]
    )


def test_noise_alone_is_found_at_its_level():
    rng = np.random.default_rng(2)
    tables = [anova(plan(L25, *rng.normal(1e-4, 1e-5, (2, 25)))) for _ in range(40)]
    p = np.array([table["p"].unstack("source") for table in tables]).reshape(-1, len(tables[0]) // 2)
    found = np.nanmean(p < 0.05, axis=0)[np.isfinite(p).any(axis=0)]
    assert len(found) == 7
    assert found[:-1].max() < 0.15 and found.mean() == pytest.approx(0.05, abs=0.03)


def test_an_interaction_is_a_lack_of_fit():
    rng = np.random.default_rng(3)
    theta, length, _ = L25.T
    square = 1e-5 * ((theta - 55) / 5) * ((length - 40) / 10) + rng.normal(0, 2e-6, 25)
    table = anova(plan(L25, square, rng.normal(0, 2e-6, 25), variance=4e-12))
    assert table.loc[("fine", "residual"), "p"] < 1e-3 < 0.02 < table.loc[("intermediate", "residual"), "p"]
    fine = table.loc["fine"]
    assert fine.loc["theta_deg", "F"] == pytest.approx(
        fine.loc["theta_deg", "mean_square"] / fine.loc["residual", "mean_square"]
    )
    alone = anova(plan(L25, square, runs=1))
    assert alone.loc[("fine", "noise"), "df"] == 0
    assert alone.loc[("fine", "residual"), ["F", "p"]].isna().all()


@pytest.mark.parametrize(
    ("designs", "factors", "told", "terms"),
    [(L25, 3, 9, 10), (L25, 2, 6, 6), (ALMOST, 3, 9, 10), (CUBE, 3, 10, 10), (LHS, 3, 10, 10)],
)
def test_what_a_plan_cannot_tell_apart(designs, factors, told, terms):
    """In the array the third level is the others' sum, or that less five: a relation of second order."""
    names = list(LEVELS)[:factors]
    found = effects.second_order(effects.scaled_designs(plan(designs, designs[:, 0]), names), names)
    assert len(found) + 1 == terms and effects.told_apart(found) == told


def test_what_interactions_look_like():
    array, cube = (anova(plan(designs, designs[:, 0])).loc["fine", "aliased"] for designs in (L25, CUBE))
    np.testing.assert_allclose(cube.dropna(), 0, atol=1e-12)
    assert array[["theta_deg x length_mm", "length_mm x friction"]].tolist() == pytest.approx([0.3, 0.3])
    assert array.drop(["designs", "residual", "noise"]).between(0.1, 0.4).all()


def test_a_factor_at_two_levels_has_no_square():
    designs = np.array(list(itertools.product([50, 60], [30, 50], [1, 2, 3], [0])), dtype=float)[:, :3]
    table = anova(plan(designs, designs[:, 0]))
    assert table.loc["fine", "df"].to_dict()["theta_deg^2"] == 0
    assert table.loc[("fine", "residual"), "df"] == len(designs) - 1 - 4


def test_the_stage_writes_its_tables_and_leaves_out_designs_without_a_run(tmp_path, caplog):
    caplog.set_level("INFO")
    data = plan(L25, 1e-6 * L25[:, 0], runs=np.where(np.arange(25) == 3, 0, 3))
    data["U_design"][3] = np.nan
    files.write_netcdf(data, tmp_path / "dataset.nc")
    outputs = tmp_path / "effects.csv", tmp_path / "anova.csv"
    effects.effects({"factors": list(LEVELS)}, tmp_path / "dataset.nc", *outputs)
    levels, table = map(files.read_table, outputs)
    columns = ["factor", "level", "objective", "J", "J_low", "J_high", "experiments"]
    assert list(levels) == columns and len(levels) == 30
    assert levels.notna().all(axis=None)
    assert list(table) == ["objective", "source", "df", "sum_of_squares", "mean_square", "F", "p", "aliased"]
    assert table.loc[table["source"] == "designs", "df"].tolist() == [23, 23]
    assert "24 designs tell 9 of the 10 terms of a second-order model apart" in caplog.text
