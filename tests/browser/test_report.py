"""The report's page in a real browser: it renders, its charts answer, nothing spills over."""

import json

import pytest

from hopperopt.report import page

pytestmark = pytest.mark.full
WIDTHS = (400, 1400)
# Number of sections upon others, how much wider the page is than its window, words covered or cut off.
FAULTS = """
const box = element => element.getBoundingClientRect();
const parts = [...document.querySelectorAll("header, nav, section")];
const upon = parts.slice(1).filter((part, n) => box(part).top < box(parts[n]).bottom - 1).length;
const common = (a, b) =>
  Math.min(a.right - b.left, b.right - a.left, a.bottom - b.top, b.bottom - a.top) > 1;
const words = [...document.querySelectorAll("svg")].flatMap(svg => {
  const texts = [...svg.querySelectorAll("text")], frame = box(svg);
  const cut = texts.filter(text => box(text).left < frame.left - 1 || box(text).right > frame.right + 1);
  const covered = texts.filter((a, n) => texts.slice(n + 1).some(b => common(box(a), box(b))));
  return [...cut, ...covered].map(text => text.textContent);
});
return [upon, document.documentElement.scrollWidth - innerWidth, words];
"""


@pytest.fixture(scope="module")
def made(make_report_study):
    return make_report_study()


@pytest.fixture(scope="module")
def report(tmp_path_factory, made):
    path = tmp_path_factory.mktemp("report") / "report.html"
    study, case_of = made
    path.write_text(page.render(study, {}, case_of, {}), encoding="utf-8")
    return path


@pytest.fixture
def opened(browser, report):
    """Function that opens the report in a window of a width."""

    def at(width=1400):
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.get(report.as_uri())
        return browser

    return at


def all_of(browser, selector, attribute):
    script = "return [...document.querySelectorAll(arguments[0])].map(e => e.getAttribute(arguments[1]))"
    return browser.execute_script(script, selector, attribute)


def text_of(browser, selector):
    return browser.execute_script("return document.querySelector(arguments[0]).textContent", selector)


def move_to(browser, selector):
    """Point at the middle of an element as drawn, and wait until a busy browser has taken notice."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.support.wait import WebDriverWait

    element = browser.find_element("css selector", selector)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
    ActionChains(browser).move_to_element(element).move_by_offset(1, 0).perform()
    below = "return arguments[0].matches(':hover')"
    WebDriverWait(browser, 30).until(lambda _: browser.execute_script(below, element))
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")


@pytest.mark.parametrize("width", WIDTHS)
def test_renders_without_errors_and_asks_for_nothing(opened, report, width):
    browser = opened(width)
    assert browser.get_log("browser") == []
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    assert {url for url in asked if not url.startswith("data:")} <= {report.as_uri()}
    drawn = browser.execute_script("return document.querySelectorAll('.chart svg path.axis').length")
    assert drawn > 20


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_overlaps_or_spills_over(opened, width):
    upon, too_wide, words = opened(width).execute_script(FAULTS)
    assert (upon, too_wide, words) == (0, 0, [])


def test_bands_stay_inside_their_charts(opened):
    above = """
    return [...document.querySelectorAll(".outflow svg")].map(svg => {
      const top = element => element.getBoundingClientRect().top;
      const bands = [...svg.querySelectorAll(".band")];
      return top(svg.querySelector(".axis")) - Math.min(...bands.map(top));
    });"""
    found = opened().execute_script(above)
    assert found and max(found) < 1


def test_pointing_at_a_curve_shows_its_experiment(opened):
    browser = opened()
    move_to(browser, "#curve-chart svg")
    (chosen,) = all_of(browser, "#curve-chart .chosen", "data-experiment")
    name = browser.find_element("css selector", f"#experiment option[value='{chosen}']").text
    told = text_of(browser, "#curve-design")
    assert told.startswith(f"{name}: θ = ") and told.endswith("mean of 1 run")


def test_an_experiment_can_be_chosen_by_name(opened):
    browser = opened()
    browser.find_element("css selector", "#experiment").send_keys("exp_07")
    assert all_of(browser, "#curve-chart .chosen", "data-experiment") == ["6"]


def test_another_size_has_other_curves(opened):
    browser = opened()
    seen = []
    for name in ("fine", "intermediate", "coarse"):
        browser.find_element("css selector", f"#sizes input[value={name}]").click()
        seen.append(tuple(all_of(browser, "#curve-chart .curve", "d")))
        assert f"{name} particles" in text_of(browser, "#curve-chart")
    assert len(set(seen)) == 3 and all(len(paths) == 25 for paths in seen)


def test_a_level_of_a_factor_shows_its_effect(opened, made):
    from selenium.webdriver import Keys

    browser, lengths = opened(), made[0].effects.query("factor == 'length_mm'")
    for size in ("fine", "intermediate"):
        browser.find_element("css selector", f"#effect-sizes input[value={size}]").click()
        for n, row in enumerate(lengths.query("objective == @size").itertuples(), start=1):
            move_to(browser, f"#effect-charts .chart:nth-child(2) .effect:nth-of-type({n})")
            told = text_of(browser, "#effect")
            J, low, high = (f"{value:.4f}".replace("-", "−") for value in (row.J, row.J_low, row.J_high))
            assert f"length {row.level:g} mm: J of the {size} particles {J} ({low} to {high})" in told
            assert told.endswith("mean of 5 experiments, " + row.experiments.replace(" ", ", "))
            (current,) = all_of(browser, "#effect-charts .current", "aria-label")
            assert current == f"length {row.level:g} mm"
    browser.find_element("css selector", "#effect-charts .current").send_keys(Keys.ARROW_RIGHT)
    assert all_of(browser, "#effect-charts .current", "aria-label") == ["height 26 mm"]


def test_a_point_of_the_front_shows_its_design(opened):
    from selenium.webdriver import Keys

    browser = opened()
    seen = []
    for n in range(1, 6):
        move_to(browser, f"#front-chart circle:nth-of-type({n})")
        (drawing,) = all_of(browser, "#front-insert", "d")
        seen.append((text_of(browser, "#front-design table"), drawing))
    assert len({words for words, _ in seen}) == len({drawing for _, drawing in seen}) == 5
    browser.find_element("css selector", "#front-chart circle:nth-of-type(5)").send_keys(Keys.ARROW_LEFT)
    assert text_of(browser, "#front-design table") == seen[3][0]
