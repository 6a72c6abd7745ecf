"""The report's page is whole and asks for nothing outside; its sentences hold whatever the study found."""

import base64
import json
import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

from hopperopt import files
from hopperopt.figures import multiples, style
from hopperopt.report import answer, charts, drawing, facts, page
from hopperopt.report.study import rounds

CASES = {"found": "selected", "no_insert": "bare"}
SECTIONS = [
    "studied", "discharge", "curves", "effects", "surrogates", "front", "verdict", "warnings", "provenance",
    "times",
]  # fmt: skip
EMPTY = {"meta", "link", "img", "input", "br"}


class Page(HTMLParser):
    """Ids, attributes that name other things, and texts by tag; refuses tags that do not match."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.places, self.open, self.texts = [], [], [], {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.ids += [given["id"]] if "id" in given else []
        self.places += [
            given[name] for name in ("src", "href", "xlink:href", "action", "data") if name in given
        ]
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in EMPTY:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        for tag in self.open[-1:]:
            self.texts.setdefault(tag, []).append(text)


@pytest.fixture(scope="module")
def rendered(make_report_study):
    return page.render(*rendering(make_report_study()))


def rendering(made, figures=None):
    """Arguments of page.render."""
    study, case_of = made
    return study, {"optimise": {"seed": 1}}, case_of, figures or {}


def test_the_page_is_whole_and_asks_for_nothing_outside(rendered):
    parsed = Page(rendered)
    assert [place for place in parsed.places if not place.startswith(("#", "data:"))] == []
    assert re.findall(r"url\((?!#)|@import|fetch\(|XMLHttpRequest", rendered) == []
    assert len(parsed.ids) == len(set(parsed.ids))
    assert [place[1:] for place in parsed.places if place.startswith("#")] == SECTIONS
    assert set(SECTIONS) <= set(parsed.ids)
    assert "Insert: slope 60°, length 50 mm, height 34 mm" in parsed.texts["p"]


def test_the_charts_have_their_data(rendered, make_report_study):
    data = json.loads("".join(Page(rendered).texts["script"][:1]))
    study, _ = make_report_study()
    assert len(data["curves"]["experiments"]) == 25
    m = np.array([experiment["mean"] for experiment in data["curves"]["experiments"]])
    np.testing.assert_allclose(m.sum(axis=1), 1, atol=2e-4)
    assert data["front"]["points"][0]["J"] == [0.01, 0.02]
    assert len({point["insert"] for point in data["front"]["points"]}) == 5
    assert len(data["outflows"]) == len(study.kinds)
    length = data["effects"][1]
    assert (length["name"], length["unit"], length["selected"]) == ("length", "mm", 50)
    assert length["words"] == ["30 mm", "35 mm", "40 mm", "45 mm", "50 mm"]
    names = [name for level in length["experiments"] for name in level]
    assert sorted(names) == study.data["experiment"].values.tolist()
    assert np.shape([length["J"]["fine"], length["J"]["intermediate"]]) == (2, 5, 3)


def test_of_a_large_plan_some_curves_are_shown_and_the_page_says_so(make_report_study, monkeypatch):
    monkeypatch.setattr(multiples, "MOST_PANELS", 10)
    one_case = {"verification": {"cases": {"selected": "selected"}, "replicates_of": {}}}
    parsed = Page(page.render(*rendering(make_report_study(one_case))))
    shown = json.loads(parsed.texts["script"][0])["curves"]["experiments"]
    assert [curve["name"] for curve in shown] == [f"exp_{n:02d}" for n in range(1, 26, 3)]
    assert any("Shown are 9 of the 25 experiments" in text for text in parsed.texts["p"])


def test_a_bin_of_designs_is_told_by_its_range(make_report_study):
    study, _ = make_report_study({"design": {"plan": "lhs", "lhs": {"experiments": 25}}})
    (angle, *_) = charts.effects(study.effects, study.data, study.words(), study.selected["design"])
    values = np.sort(study.data["theta_deg"].values).reshape(5, 5)
    assert angle["words"] == [f"{row[0]:.3g}° to {row[-1]:.3g}°" for row in values]


@pytest.mark.parametrize("insert", ["cone", "profile", "none"])
def test_four_factors_and_other_inserts(make_report_study, tmp_path, monkeypatch, insert):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "body.csv").write_text("r_mm,z_mm\n0,0\n10,0\n10,5\n0,20\n")
    names = {"level": "filling.level_mm", "mu_a": "contact.wall.static_friction"}
    names |= {"mu_b": "contact.particle.static_friction", "outlet_mm": "hopper.outlet_radius_mm"}
    levels = {"level": [70, 71, 72, 73, 74], "outlet_mm": [20, 20.5, 21, 21.5, 22]}
    levels["mu_a"] = levels["mu_b"] = [0.3, 0.35, 0.4, 0.45, 0.5]
    document = {
        "factors": {name: {"key": key, "levels": levels[name]} for name, key in names.items()},
        "insert": {"shape": insert, "height_mm": 30, "profile": {"file": "body.csv"}},
        "verification": {"cases": {"selected": "selected"}, "replicates_of": {}},
    }
    text = page.render(*rendering(make_report_study(document)))
    parsed = Page(text)
    assert {"wall static friction", "particle static friction", "outlet radius"} <= set(parsed.texts["th"])
    assert any(words.startswith("Level ") for words in parsed.texts["p"])
    assert ('class="insert solid" d="M' in text) == (insert != "none")


def test_hostile_names_are_text(make_report_study):
    evil = '</script><script>alert("x")</script><img/src=x/onerror=alert(1)>'
    study, case_of = make_report_study()
    attributes = next(iter(study.plan.values())).attrs | {"git": evil, "host": evil}
    plan = {(f"{name}{evil}", n): run.assign_attrs(attributes) for (name, n), run in study.plan.items()}
    data = study.data.assign_coords(experiment=[f"{name}{evil}" for name in study.data["experiment"].values])
    selected = study.selected | {"warning": evil}
    named = [" ".join(name + evil for name in names.split()) for names in study.effects["experiments"]]
    effects = study.effects.assign(experiments=named)
    made = study._replace(plan=plan, data=data, effects=effects, selected=selected)
    parsed = Page(page.render(made, {"a": evil}, case_of, {}))
    assert len(parsed.texts["script"]) == 2
    assert not any(place == "x" for place in parsed.places)
    told = json.loads(parsed.texts["script"][0])
    assert told["curves"]["experiments"][0]["name"].endswith(evil)
    assert told["effects"][0]["experiments"][0][0].endswith(evil)


def test_runs_that_did_not_end_well_are_told(make_report_study):
    study, case_of = make_report_study()
    bad = {key: run.assign(status="jammed") for key, run in study.verification.items() if key[0] == "bare"}
    text = page.render(*rendering((study._replace(verification=study.verification | bad), case_of)))
    assert "1 run did not end well and is left out" in text
    assert "Bare, filling 1: jammed" in text and "No simulation ended well" in text


def test_designs_of_infill_stand_beside_what_came_of_them(make_report_study, tmp_path):
    """One round's design was dropped: it has no simulated J."""
    study, case_of = make_report_study()
    assert "<h2>Infill" not in page.render(*rendering((study, case_of)))
    design = study.selected["design"]
    names = ["infill_1_1", "infill_1_2"]
    proposed = [{"experiment": n, **design, "chosen_as": "improvement", **PREDICTED} for n in names]
    files.write_table(pd.DataFrame(proposed), tmp_path / "proposals.csv")
    simulated = {"fine": 0.0225, "fine_low": 0.02, "fine_high": 0.025}
    simulated |= {name.replace("fine", "intermediate"): 2 * value for name, value in simulated.items()}
    done = pd.DataFrame(
        [{"experiment": "infill_1_1", **design, "runs": 3, **simulated}, {"experiment": "exp_01"}]
    )
    files.write_table(done, tmp_path / "designs.csv")
    table = rounds([tmp_path / "proposals.csv"], [tmp_path / "designs.csv"])
    runs = {("infill_1_1", 1): next(iter(study.plan.values())).assign(status="jammed")}
    text = page.render(*rendering((study._replace(proposals=table, infill=runs), case_of)))
    assert '<a href="#infill">' in text and "0.0117" in text and "0.0225 (0.0200 to 0.0250)" in text
    row = text[text.index(">1.2<") :]
    assert row[: row.index("</tr>")].endswith('<td class="number">0.0338</td><td class="number"></td>')
    assert "Infill_1_1, filling 1: jammed" in text
    assert len(rounds([], [])) == 0


PREDICTED = {"J_fine": 0.0117, "J_intermediate": 0.0338, "expected_improvement": 0.01}


def test_figures_are_part_of_the_file(make_report_study, tmp_path):
    """All in one scale, whatever their resolution: letters of one size."""
    sizes = {"errors": (style.PAGE, 50), "verification": (style.COLUMN, 100)}
    for name, (width, dpi) in sizes.items():
        style.save(style.page(width, 40), [tmp_path / f"{name}.png"], dpi)
    text = page.render(*rendering(make_report_study(), {name: tmp_path / f"{name}.png" for name in sizes}))
    source = base64.b64encode((tmp_path / "errors.png").read_bytes()).decode()
    assert f'src="data:image/png;base64,{source}" style="width: 52rem"' in text
    assert 'style="width: 25rem" alt="Predicted and simulated outflow' in text


def test_the_bed_is_drawn_as_high_as_it_was(make_report_study):
    study, *rest = rendering(make_report_study())
    for number, run in enumerate((study.plan | study.verification).values()):
        run["filling_level"] = 0.0361 if number else 0.0345
    text = page.render(study, *rest)
    assert "bed 36 mm" in text and "34.5 to 36.1 mm above the outlet, aimed at 74 mm" in text


def table(selected=("better", "better"), simulated=0.012, bare=0.03, z=0.5):
    """Rows of verdict.csv of the cases CASES."""
    rows = []
    for case, words, J in (("found", selected, simulated), ("no_insert", (None, None), bare)):
        for name, word in zip(("fine", "intermediate"), words, strict=True):
            values = {"n": 2, "predicted": 0.01, "simulated": J, "low": J - 0.002, "high": J + 0.002, "z": z}
            difference = {"diff_low": -9e-4, "diff_high": 3e-4, "p_holm": 0.003}
            rows.append({"case": case, "objective": name, **values, **difference, "verdict": word})
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("better", "better"), "the fine and the intermediate particles segregate less."),
        (("worse", "worse"), "the fine and the intermediate particles segregate more."),
        (
            ("better", "worse"),
            "the fine particles segregate less, and the intermediate particles segregate more.",
        ),
        (
            ("not distinguishable", "better"),
            "no difference can be told for the fine particles, "
            "and the intermediate particles segregate less.",
        ),
        (
            ("not distinguishable",) * 2,
            "no difference can be told for the fine and the intermediate particles.",
        ),
    ],
)
def test_headline_of_every_verdict(words, said):
    headline = answer.answer(CASES, table(words)).headline
    assert headline == f"With the selected design, compared with the bare hopper, {said}"


@pytest.mark.parametrize(
    ("cases", "rows", "said"),
    [
        ({"found": "selected"}, table().query("case == 'found'"), "no bare hopper"),
        ({"no_insert": "bare"}, table(), "no selected design"),
        (CASES, table(simulated=np.nan), "No simulation of the selected design"),
        (CASES, table(bare=np.nan), "No simulation of the bare hopper"),
    ],
)
def test_what_cannot_be_said(cases, rows, said):
    told = answer.answer(cases, rows)
    assert said in told.headline
    assert not re.search("nan|less|more", " ".join([told.headline, *told.details]))


def test_sentences_below_the_headline():
    text = " ".join(answer.answer(CASES, table(("better", "worse"), 0.012), ["fine"], 2).details)
    assert "J is 0.0120 (90\u00a0% interval 0.0100 to 0.0140, 2 simulations)" in text
    assert "in the bare hopper 0.0300" in text
    assert "That is less, by 60\u00a0% (one-sided test, p = 0.003)." in text
    assert "agree with that within their noise" in text
    assert "No effect of the design was found on how the fine particles segregate" in text
    assert "2 runs did not end well and are left out" in text
    text = " ".join(answer.answer(CASES, table(("not distinguishable",) * 2, -0.001, z=3)).details)
    assert "between −9.0·10⁻⁴ and 3.0·10⁻⁴" in text and "J is −0.0010" in text and "by -" not in text
    assert "above it for the fine particles and above it for the intermediate particles" in text


def test_factors_are_called_by_their_keys():
    keys = {
        "a": "insert.cone.slope_deg",
        "b": "contact.wall.restitution",
        "c": "contact.particle.restitution",
    }
    words = facts.factor_words(keys | {"d": "discharge.time_limit_s"})
    assert words == {
        "a": "slope", "b": "wall restitution", "c": "particle restitution", "d": "time limit"
    }  # fmt: skip


def test_walls_are_drawn_as_they_are():
    cone = np.array([[0, 10], [5, 10], [0, 20]])
    assert (
        drawing.outline(cone).path
        == "M0.00,-20.00L-5.00,-10.00L0.00,-10.00L0.00,-10.00L5.00,-10.00L0.00,-20.00Z"
    )
    shell = drawing.outline(np.array([[3, 10], [5, 12]]))
    assert not shell.solid and shell.path.count("M") == 2 and "Z" not in shell.path
    ring = drawing.outline(np.array([[3, 10], [5, 10], [5, 12], [3, 10]]))
    assert ring.solid and ring.path.count("Z") == 2


def test_dimensions_are_the_hoppers():
    walls = {
        "hopper": np.array([[22.5, 0], [50, 27.5], [50, 200]]),
        "gate": np.array([[0, 0], [22.5, 0]]),
        "insert": np.array([[0, 29.6], [20, 29.6], [0, 60]]),
    }
    lines, (left, right, bottom, top) = drawing.dimensions(walls, 74)
    texts = [line.text for line in lines]
    assert texts == ["⌀ 100 mm", "⌀ 45 mm", "bed 74 mm", "29.6 mm", "30.4 mm", "⌀ 40 mm"]
    for line in lines:
        assert left < min(line.x1, line.x2) and max(line.x1, line.x2) < right
        assert bottom < -line.y1 < top
