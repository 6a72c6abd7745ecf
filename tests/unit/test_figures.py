"""Figures show what they should, their texts can be read, and drawing them again gives the same files."""

import inspect
import itertools
import json
import math
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.testing.compare import compare_images
from matplotlib.text import Text

from hopperopt import cli, config, dataset, files, outflow, preview, provenance
from hopperopt.figures import (
    curves,
    effects,
    errors,
    extremes,
    fit,
    front,
    hopper,
    indices,
    labels,
    multiples,
    sensitivity,
    spheres,
    style,
    verdict,
    verification,
)
from hopperopt.surrogate import targets, validation

FIGURES = (hopper, curves, indices, effects, fit, verification, verdict, front, errors, sensitivity)
BATCH = np.array([8, 27, 64]) / 99
FACTORS = {"theta_deg": (50.0, 60.0), "length_mm": (30.0, 50.0), "height_mm": (26.0, 34.0)}
CASE = {
    "walls": {
        "hopper": [[0.0225, 0], [0.05, 0.0275], [0.05, 0.2]],
        "gate": [[0, 0], [0.0225, 0]],
        "insert": [[0, 0.0296], [0.02, 0.0296], [0, 0.06]],
    },
    "particles": {"diameters": [0.002, 0.003, 0.004]},
    "discharge": {"sensor": -0.012},
    "design": {"theta_deg": 55.0, "length_mm": 40.0, "height_mm": 29.6},
}


@pytest.fixture
def make_plan(make_run):
    """Function that returns a plan's data set, without segregation, of so many experiments."""

    def plan(experiments=25, replicates=1, factors=3, count=400, dropped=(), name="exp_{:02d}"):
        rng = np.random.default_rng(3)
        names = [name.format(n) for n in range(1, experiments + 1)]
        known = FACTORS | {"outlet_radius_mm": (20.0, 25.0), "b": (0, 1), "c": (0, 1)}
        columns = dict(itertools.islice(known.items(), factors))
        values = {name: rng.uniform(*limits, experiments).round(2) for name, limits in columns.items()}
        runs = {
            (name, r): make_run(count, seed=100 * n + r)
            for n, name in enumerate(names)
            for r in range(1, replicates + 1)
        }
        table = pd.DataFrame(values, index=pd.Index(names, name="experiment"))
        return dataset.assemble(table, runs, dict.fromkeys(dropped, "jammed"))

    return plan


@pytest.fixture
def make_training(make_plan, tmp_path):
    """Function that returns the training data of a plan, and smooth curves as a network's."""

    def training(split="experiments", **plan):
        data = make_plan(**plan)
        data.to_netcdf(tmp_path / "dataset.nc")
        params = {"factors": data.attrs["factors"].split(), "clip_sigma": 2.0, "split": split, "seed": 1}
        held_out = {"validation_experiments": 1, "test_experiments": 1}
        targets.filter_targets(params | held_out, tmp_path / "dataset.nc", tmp_path / "training.nc")
        result = xr.load_dataset(tmp_path / "training.nc")
        return result, result["target"].mean("M").values[..., None] + 0.02 * np.sin(outflow.GRID)

    return training


@pytest.fixture
def run():
    """A few particles around the insert's cone, one of which has left when half of the mass has."""
    rng = np.random.default_rng(1)
    size_class = np.arange(60) % 3
    radius, angle = rng.uniform(0.025, 0.045, 60), rng.uniform(0, 2 * np.pi, 60)
    position = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0.03, 0.07, 60)])
    half = np.where(np.arange(60)[:, None] == 0, np.nan, position)
    return xr.Dataset(
        {
            "exit_time": ("particle", np.linspace(0.1, 1.1, 60)),
            "diameter": ("particle", np.array([0.002, 0.003, 0.004])[size_class]),
            "size_class": ("particle", size_class),
            "position_opening": (("particle", "xyz"), position),
            "position_half": (("particle", "xyz"), half),
        },
        attrs={"case": json.dumps(CASE)},
    )


def table_of_methods(*left_out):
    rng = np.random.default_rng(2)
    methods = [name for name in validation.METHODS if name not in left_out]
    columns = [f"{kind}_{k}" for kind in ("curve_rmse", "objective") for k in "fi"]
    table = pd.DataFrame({name: rng.uniform(0.003, 0.012, len(methods)) for name in columns}, index=methods)
    table = table.rename(columns={f"objective_{k}": f"objective_{k}_rmse" for k in "fi"})
    table["coverage_90"] = rng.uniform(0.3, 0.95, len(methods))
    no_curve = table.index.isin(["quadratic", "mean_objective"])
    table.loc[no_curve, ["curve_rmse_f", "curve_rmse_i", "coverage_90"]] = np.nan
    return table.rename_axis("method").reset_index()


def table_of_front(points=30, feasible=True, selected=9):
    J = np.linspace(0.004, 0.012, points)
    designs = {name: np.linspace(*limits, points) for name, limits in FACTORS.items()}
    marks = {"feasible": feasible, "selected": np.arange(points) == selected}
    return pd.DataFrame({**designs, "J_fine": J, "J_intermediate": 6e-5 / J, **marks})


def table_of_cases(simulated=(0.006, 0.009), half=0.004):
    cases = {
        "selected": (0.006, 0),
        "best_f": (0.005, -0.002),
        "best_i": (0.008, 0.002),
        "plan_best": (0.007, 0.004),
    }
    cases |= {"plan_centre": (0.012, 0.008), "paper": (0.011, 0.007), "bare": (None, 0.02)}
    words = ["better", "better", "worse", "not distinguishable", "not distinguishable", "better", None]
    rows = [
        {
            "case": case,
            "objective": name,
            "predicted": predicted,
            "predicted_low": predicted and predicted - 0.002,
            "predicted_high": predicted and predicted + 0.002,
            "simulated": value + shift,
            "low": value + shift - half,
            "high": value + shift + half,
            "verdict": word,
        }
        for (case, (predicted, shift)), word in zip(cases.items(), words, strict=True)
        for name, value in zip(style.OBJECTIVES, simulated, strict=True)
    ]
    return pd.DataFrame(rows)


def table_of_designs():
    values = {f"{name}{end}": [0.002, 0.01] for name in style.OBJECTIVES for end in ("", "_low", "_high")}
    return pd.DataFrame({"experiment": ["exp_02", "exp_01"], "runs": 3, **values, "rank": [1, 2]})


def written(figure):
    """Texts that are drawn in a figure, with the boxes of their words in pixels."""
    drawn, draw = [], Text.draw
    with mock.patch.object(Text, "draw", lambda text, renderer: (drawn.append(text), draw(text, renderer))):
        figure.draw_without_rendering()
    return [
        (text, Text.get_window_extent(text))
        for text in drawn
        if text.get_visible() and text.get_text().strip()
    ]


def check_texts(figure):
    """No text is small, cut off, or upon another; the figure has a width that columns in print have.

    Returns the texts.
    """
    assert style.size(figure)[0] <= style.PAGE + 0.01
    texts = written(figure)
    assert texts
    page = figure.bbox
    for text, box in texts:
        assert text.get_fontsize() >= 7, text
        inside = page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1
        assert inside, f"{text} is cut off"
    for (first, a), (second, b) in itertools.combinations(texts, 2):
        overlap = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(overlap) < 1, f"{first} lies upon {second}"
    return [text for text, _ in texts]


@pytest.mark.parametrize(
    "plan",
    [
        {},
        {"experiments": 1, "count": 100},
        {"experiments": 10, "factors": 4},
        pytest.param({"factors": 4}, marks=pytest.mark.full),
        {"experiments": 7, "replicates": 2, "factors": 6},
        {"experiments": 12, "dropped": [("exp_04", 1)]},
        {"experiments": 5, "name": "long_name_{}"},
    ],
)
def test_curves_can_be_read_for_any_number_of_experiments(make_plan, plan):
    figure = curves.draw(make_plan(**plan))
    words = [text.get_text() for text in check_texts(figure)]
    assert len(figure.axes) == plan.get("experiments", 25)
    assert words.count("no complete run") == len(plan.get("dropped", ()))


def test_factors_stand_in_the_studys_order(make_plan, make_training, tmp_path):
    """A netCDF file gives its coordinates back in another one."""
    files.write_netcdf(make_plan(5), tmp_path / "plan.nc")
    for figure in (
        curves.draw(files.read_netcdf(tmp_path / "plan.nc")),
        fit.draw(*make_training(experiments=10)),
    ):
        assert "$\\theta$ (°),  $L$ (mm),  $H$ (mm)" in [text.get_text() for text, _ in written(figure)]


def test_a_page_of_panels_shows_some_of_many_experiments(make_training, tmp_path, monkeypatch):
    """An image of thousands of panels would be larger than any program draws."""
    training, _ = make_training(experiments=12, count=100)
    drawn, factors = [], tuple(training.attrs["factors"].split())
    model = mock.Mock(factors=factors, curves=lambda designs: np.full((len(designs), 2, 21), 0.1))
    monkeypatch.setattr(fit.prediction, "load", lambda path: model)
    monkeypatch.setattr(style, "save", lambda figure, *rest: drawn.append(figure))
    monkeypatch.setattr(multiples, "MOST_PANELS", 5)
    curves.write({"dpi": 50}, tmp_path / "dataset.nc", [])
    fit.write({"dpi": 50}, tmp_path / "training.nc", tmp_path / "network.nc", [])
    for figure in drawn:
        assert [axes.get_title(loc="left") for axes in figure.axes] == ["1", "4", "7", "10"]
    assert len(drawn) == 2


SMALL_PLAN = {"experiments": 10, "factors": 1, "count": 100}


@pytest.mark.parametrize(
    ("split", "plan"),
    [
        ("experiments", {}),
        ("points", SMALL_PLAN),
        pytest.param("points", {}, marks=pytest.mark.full),
        pytest.param("experiments", SMALL_PLAN, marks=pytest.mark.full),
    ],
)
def test_fit_can_be_read_and_tells_what_did_not_train(make_training, split, plan):
    training, predicted = make_training(split, **plan)
    figure = fit.draw(training, predicted)
    words = [text.get_text() for text in check_texts(figure)]
    assert words.count("validation") == words.count("test") == 1
    if split == "experiments":
        panel = next(axes for axes in figure.axes if "test" in [text.get_text() for text in axes.texts])
        tested = training["experiment"].values[training["split"].values == "test"].item()
        assert panel.get_title(loc="left") == str(int(tested.removeprefix("exp_")))


def test_fit_shows_what_the_clip_moved(make_training):
    training, predicted = make_training()
    figure = fit.draw(training, predicted)
    crosses = [line for axes in figure.axes for line in axes.lines if line.get_marker() == "x"]
    shown = np.sort(np.concatenate([line.get_ydata() for line in crosses]))
    moved = training["target"].values[training["target"].values != training["target_clipped"].values]
    assert len(moved) > 0
    np.testing.assert_array_equal(shown, np.sort(moved))


@pytest.mark.parametrize("replicates", [0, 1, 3])
def test_verification_can_be_read(make_run, replicates):
    runs = [make_run(seed=seed) for seed in range(replicates)]
    figure = verification.draw(runs, CASE["design"], BATCH[:2], np.repeat(BATCH[:2, None], 21, axis=1))
    check_texts(figure)
    check_texts(verification.draw(runs, {}, BATCH[:2], None))


def test_nine_of_ten_points_lie_in_the_band_around_a_right_prediction(make_run):
    inside = []
    for seed in range(30):
        figure = verification.draw(
            [make_run(2000, seed)], CASE["design"], BATCH[:2], np.repeat(BATCH[:2, None], 21, 1)
        )
        axes = figure.axes[0]
        simulated = [line.get_ydata() for line in axes.lines if line.get_markerfacecolor() == "none"]
        for points, band in zip(simulated, axes.collections, strict=True):
            corners = band.get_paths()[0].vertices
            limits = [corners[np.isclose(corners[:, 0], M), 1] for M in outflow.GRID]
            inside += [low.min() <= y <= low.max() for low, y in zip(limits, points, strict=True)]
    assert np.mean(inside) == pytest.approx(0.9, abs=0.03)


@pytest.mark.parametrize(
    ("found", "cases"),
    [
        (table_of_front(), table_of_cases()),
        (table_of_front(1, selected=0), table_of_cases((-0.01, -0.03), 0.05)),
        (table_of_front(5, feasible=False, selected=-1), table_of_cases((np.nan, np.nan))),
    ],
)
def test_front_and_verdict_can_be_read(make_plan, found, cases):
    figure = front.draw(found, make_plan(10), cases)
    words = {text.get_text() for text in check_texts(figure)}
    if cases["simulated"].notna().all():
        assert {"plan centre", "bare", "selected"} <= words
    figure = verdict.draw(cases, table_of_designs())
    words = [text.get_text() for text in check_texts(figure)]
    assert words.count("plan best") == 1 and words.count("better") == 6 and words.count("worse") == 2


def test_a_front_of_hardly_any_length_is_not_blown_up(make_plan):
    found = table_of_front()
    for name in front.COLUMNS:
        found[name] = 0.0333 + 1e-6 * found[name]
    figure = front.draw(found, make_plan(10), table_of_cases())
    check_texts(figure)
    near = figure.axes[0]
    for axis, name in zip((near.xaxis, near.yaxis), front.COLUMNS, strict=True):
        low, high = axis.get_view_interval()
        assert np.diff([low, found[name].min(), found[name].max(), high]).min() >= 0
        assert high - low == pytest.approx(front.CLOSEST) and axis.get_offset_text().get_text() == ""


@pytest.mark.parametrize("feasible", [True, False])
def test_designs_of_infill_have_a_mark_of_their_own(make_plan, feasible):
    plan = make_plan(10)
    names = ["exp_01", "exp_02", "exp_03", "exp_04", "exp_05", "exp_06", "exp_07", "exp_08", "infill_1_1"]
    figure = front.draw(
        table_of_front(feasible=feasible),
        plan.assign_coords(experiment=[*names, "infill_1_2"]),
        table_of_cases(),
    )
    words = {text.get_text() for text in check_texts(figure)}
    marks = {line.get_marker(): len(line.get_xdata()) for line in figure.axes[1].lines}
    assert marks["^"] == 2
    assert {"plan", "infill"} <= words


def test_verdict_shows_the_luck_of_the_plans_best():
    panel = verdict.draw(table_of_cases(), table_of_designs()).axes[0]
    at = [case.get_text() for case in panel.get_yticklabels()].index("plan best")
    marks = {
        line.get_marker(): line.get_xdata()[0] for line in panel.lines if round(line.get_ydata()[0]) == at
    }
    assert {marker: marks[marker] for marker in "Dos"} == pytest.approx({"D": 0.010, "o": 0.007, "s": 0.002})
    other = verdict.draw(table_of_cases().query("case != 'plan_best'"), table_of_designs())
    assert not [line for line in other.axes[0].lines if line.get_marker() == "s"]


@pytest.mark.parametrize("replicates", [1, 4])
def test_nine_of_ten_points_of_a_plan_lie_in_the_bands_around_their_mean(make_plan, replicates):
    """Outflow without segregation: nine of ten bands around a mean hold the batch's fraction."""
    plan = make_plan(20, replicates, count=300)
    covered = []
    for panel in curves.draw(plan).axes:
        for band, target in zip(panel.collections, plan["target_fraction"].values, strict=True):
            corners = band.get_paths()[0].vertices
            for M in outflow.GRID:
                limits = corners[np.isclose(corners[:, 0], M), 1]
                covered.append(limits.min() <= target <= limits.max())
    assert np.mean(covered) == pytest.approx(0.9, abs=0.03)


def test_errors_can_be_read_and_tell_the_surrogate_that_is_used():
    for chosen, left_out in (("gaussian", ()), ("network", ("network_clipped", "ensemble_clipped"))):
        figure = errors.draw(table_of_methods(*left_out), chosen)
        words = [text.get_text() for text in check_texts(figure) if text.get_fontweight() == "bold"]
        assert words == [errors.WORDS[chosen]]
        assert len(figure.axes[0].get_yticks()) == 10 - len(left_out)


@pytest.mark.parametrize("plan", [{}, {"experiments": 1}, {"experiments": 7, "replicates": 3}])
def test_indices_can_be_read(make_plan, plan):
    check_texts(indices.draw(make_plan(**plan)))


def test_an_index_that_no_run_has_is_told(make_plan):
    plan = make_plan(7)
    figure = indices.draw(plan.assign(mass_flow_index=np.nan * plan["mass_flow_index"]))
    (words,) = [text for text in check_texts(figure) if text.get_text() == "not measured"]
    assert words.axes.get_title(loc="left") == "mass-flow index" and words.axes.get_yticks().size == 0


def test_indices_are_drawn_by_rank_and_as_means_of_runs(make_plan):
    data = make_plan(6, 2, dropped=[("exp_02", 1)])
    panel = indices.draw(data).axes[list(indices.PANELS).index("residence_order")]
    order = dataset.ranked_designs(data)["experiment"].tolist()
    mean = data["residence_order"].sel(experiment=order).mean("replicate")
    np.testing.assert_allclose(panel.lines[0].get_xydata(), np.column_stack([np.arange(1, 7), mean]))


def test_some_of_many_designs_are_drawn_at_their_ranks(make_plan, monkeypatch):
    """The dots and lines of thousands would be a solid band."""
    data = make_plan(12, count=100)
    monkeypatch.setattr(indices, "MOST_DESIGNS", 5)
    panel = indices.draw(data).axes[list(indices.PANELS).index("residence_order")]
    order = dataset.ranked_designs(data)["experiment"].tolist()[::3]
    mean = data["residence_order"].sel(experiment=order).mean("replicate")
    np.testing.assert_allclose(panel.lines[0].get_xydata(), np.column_stack([[1, 4, 7, 10], mean]))


def table_of_effects(factors, shift=0.0):
    rows = itertools.product(factors, range(5), style.OBJECTIVES)
    table = pd.DataFrame(rows, columns=["factor", "level", "objective"])
    table["J"] = 0.01 + 0.001 * table["level"] - shift
    return table.assign(J_low=table["J"] - 0.003, J_high=table["J"] + 0.004)


@pytest.mark.parametrize("factors", [["theta_deg"], [*FACTORS], [*FACTORS, "friction", "outlet_mm", "c"]])
def test_effects_can_be_read(factors):
    for shift in (0, 0.02):
        figure = effects.draw(table_of_effects(factors, shift))
        check_texts(figure)
        shown = [panel for panel in figure.axes if panel.get_visible()]
        assert len(shown) == 2 * len(factors)
        for panel in shown:
            low, high = panel.get_ylim()
            band = panel.collections[0].get_paths()[0].vertices[:, 1]
            assert low <= band.min() and band.max() <= high


def table_of_sensitivity(factors, half=0.3):
    rows = list(itertools.product(sensitivity.TITLES, factors))
    table = pd.DataFrame(rows, columns=["output", "factor"]).assign(first=0.2, total=0.6)
    for kind in ("first", "total"):
        table[f"{kind}_low"], table[f"{kind}_high"] = table[kind] - half, table[kind] + half
    return table


@pytest.mark.parametrize("factors", [["theta_deg"], [*FACTORS], [*FACTORS, "friction", "outlet_mm", "c"]])
def test_sensitivity_can_be_read(factors):
    for half in (0.3, np.nan):
        check_texts(sensitivity.draw(table_of_sensitivity(factors, half)))


def test_hopper_can_be_read(run, monkeypatch):
    monkeypatch.setattr(style, "IMAGE_DPI", 50)  # of the spheres, no part of the texts
    for insert in ("insert", "none"):
        case = json.loads(run.attrs["case"])
        if insert == "none":
            case["walls"]["insert"], case["design"] = None, {}
        check_texts(hopper.draw(run.assign_attrs(case=json.dumps(case))))
    never = run.assign(position_half=run["position_half"] * np.nan)
    assert any("never" in text.get_text() for text, _ in written(hopper.draw(never)))


@pytest.mark.parametrize("name", ["fourth_factor", "bullet", "double_cone", "cone_in_cone", "profile"])
def test_extremes_can_be_read(name):
    root = provenance.PACKAGE.parents[1]
    paths = [root / "config.yaml", root / f"config/examples/{name}.yaml"]
    figure = extremes.draw(preview.sketches(config.parse(config.load(paths), root)))
    words = " ".join(text.get_text() for text in check_texts(figure))
    assert "smallest gap" in words and "level of the bed, 74 mm" in words


def test_extremes_of_small_inserts_can_be_read():
    lengths = {"key": "insert.cone.length_mm", "levels": [28, 26, 24, 22, 20]}
    changes = {
        "hopper": {"outlet_radius_mm": 30, "cylinder_radius_mm": 60},
        "particles": {"diameters_mm": [5, 6, 8]},
        "factors": {"length_mm": lengths},
    }
    check_texts(extremes.draw(preview.sketches(config.parse(changes))))


def test_extremes_of_a_bare_hopper_are_one(run):
    study = config.parse(
        {
            "insert": {"shape": "none"},
            "factors": {
                "height_mm": None,
                "length_mm": None,
                "theta_deg": None,
                "outlet_radius_mm": {"key": "hopper.outlet_radius_mm", "levels": [20, 21, 22, 23, 24]},
            },
        }
    )
    figure = extremes.draw(preview.sketches(study))
    check_texts(figure)
    assert len(figure.axes) == 1


def test_hopper_shows_the_particles_behind_the_cut_at_their_place(run):
    pair = run.isel(particle=[0, 2])
    pair["position_opening"][:] = [[0.03, 0.01, 0.05], [-0.03, -0.01, 0.05]]
    figure = hopper.draw(pair)
    for panel, seen, place in ((0, 0, 30), (1, 1, -10)):
        picture = figure.axes[panel].images[0]
        left, right, bottom, top = picture.get_extent()
        image = picture.get_array()
        rows, columns = np.nonzero(image[..., 3] > 0.5)
        x = left + (columns.mean() + 0.5) / image.shape[1] * (right - left)
        z = top - (rows.mean() + 0.5) / image.shape[0] * (top - bottom)
        assert (x, z) == pytest.approx((place, 50), abs=0.3)
        covered = len(rows) * (right - left) * (top - bottom) / image[..., 3].size
        assert covered == pytest.approx(math.pi * (500 * pair["diameter"].values[seen]) ** 2, rel=0.1)


def test_the_nearest_sphere_is_seen():
    view = spheres.View(-2, 2, -2, 2, resolution=20)
    red, blue = np.array(to_rgb("red")), np.array(to_rgb("blue"))
    for depths, top in (((0, 1), 0), ((1, 0), 2)):
        centre = np.array([[0, 0, depths[0]], [0.5, 0, depths[1]]], float)
        image = spheres.render(centre, np.ones(2), np.array([red, blue]), view, depth=10)
        middle = image[40, 44]
        assert middle[3] == 1 and np.argmax(middle[:3]) == top
        assert image[40, 24, 0] > image[40, 24, 2] and image[40, 64, 2] > image[40, 64, 0]
        assert image[0, 0, 3] == 0


def test_labels_move_apart_in_their_order_and_no_farther_than_needed():
    assert labels.spread([3, 1, 2], 0.5).tolist() == [3, 1, 2]
    moved = labels.spread([0.5, 0.5, 0.45, 3], 1)
    assert np.diff(np.sort(moved)).min() >= 1 - 1e-12
    assert np.argsort(moved).tolist() == [2, 0, 1, 3]
    assert moved[:3].mean() == pytest.approx(np.mean([0.5, 0.5, 0.45]))


def test_designs_in_words():
    design = {"height_mm": 33.0, "outlet_radius_mm": 21.25, "wall_friction": 0.5, "theta_deg": 56.71}
    words = r"$\theta$ = 56.7°, $H$ = 33 mm, outlet radius = 21.2 mm, wall friction = 0.5"
    assert style.design_text(design) == words
    assert (
        style.design_text({"density_kg_m3": 950, "fall_m_s2": 9.81})
        == "density = 950 kg/m³, fall = 9.81 m/s²"
    )


def test_files_are_the_same_every_time(tmp_path):
    for folder in ("first", "second"):
        paths = [tmp_path / folder / f"errors.{suffix}" for suffix in ("png", "pdf")]
        table_of_methods().to_csv(tmp_path / "validation.csv", index=False)
        xr.Dataset(attrs={"surrogate": "ensemble"}).to_netcdf(tmp_path / "model.nc")
        errors.write({"dpi": 100}, tmp_path / "validation.csv", tmp_path / "model.nc", paths)
    for suffix in ("png", "pdf"):
        first, second = (
            (tmp_path / folder / f"errors.{suffix}").read_bytes() for folder in ("first", "second")
        )
        assert first == second
        assert not [
            word for word in (b"CreationDate", b"Producer", b"atplotlib v", b"Software") if word in first
        ]
    assert len(list((tmp_path / "first").iterdir())) == 2


@pytest.mark.parametrize("name", cli.FIGURES)
def test_every_figure_takes_the_inputs_of_its_command(name):
    modules = {module.__name__.rpartition(".")[2]: module for module in FIGURES}
    parameters = inspect.signature(modules[name].write).parameters
    assert list(parameters) == ["params", *(option.rstrip("*") for option in cli.FIGURES[name]), "outputs"]


BASELINE = Path(__file__).parent / "baseline"
TOLERANCE = 1.0  # rms of 255; a label elsewhere or another colour of a line is above it


@pytest.mark.parametrize("name", cli.FIGURES)
def test_looks_as_it_did(name, make_plan, make_training, make_run, run, tmp_path):
    """To renew the images: rm tests/unit/baseline/*.png; make test writes new ones. Look at each of them."""
    draw = {
        "hopper": lambda: hopper.draw(run),
        "curves": lambda: curves.draw(make_plan(7, replicates=2, dropped=[("exp_04", 1), ("exp_04", 2)])),
        "indices": lambda: indices.draw(make_plan(7, replicates=2)),
        "effects": lambda: effects.draw(table_of_effects(FACTORS)),
        "sensitivity": lambda: sensitivity.draw(table_of_sensitivity(FACTORS)),
        "fit": lambda: fit.draw(*make_training(experiments=7)),
        "verification": lambda: verification.draw(
            [make_run(seed=1)], CASE["design"], BATCH[:2], np.repeat(BATCH[:2, None], 21, axis=1)
        ),
        "verdict": lambda: verdict.draw(table_of_cases(), table_of_designs()),
        "front": lambda: front.draw(table_of_front(), make_plan(10), table_of_cases()),
        "errors": lambda: errors.draw(table_of_methods(), "gaussian"),
    }
    drawn, kept = tmp_path / f"{name}.png", BASELINE / f"{name}.png"
    style.save(draw[name](), [drawn], 60)
    if not kept.exists():
        kept.parent.mkdir(exist_ok=True)
        kept.write_bytes(drawn.read_bytes())
        pytest.fail(f"{kept} was missing and is written: look at it, and test again")
    assert compare_images(str(kept), str(drawn), TOLERANCE) is None
