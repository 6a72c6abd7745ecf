"""Snakemake's own report of a finished study, in a real browser: whole, in its categories, explained."""

import pytest

from hopperopt import cli, status

pytestmark = pytest.mark.full
# Of each result: its category, name and caption.
RESULTS = """
return Object.entries(categories).flatMap(([category, parts]) =>
  Object.values(parts).flat().map(path => [category, results[path].name, results[path].caption]));
"""


@pytest.fixture(scope="module")
def opened(browser, finished, tmp_path_factory):
    """The browser with the report open."""
    path = tmp_path_factory.mktemp("snakemake") / "report.html"
    answer = finished.snakemake("--report", path)
    assert answer.returncode == 0, answer.stdout
    browser.get_log("browser")  # what went before
    browser.get(path.as_uri())
    return browser


def test_every_figure_and_table_is_there_and_explained(opened):
    found = opened.execute_script(RESULTS)
    names = {category: {name for own, name, _ in found if own == category} for category, _, _ in found}
    assert names["Figures"] == {f"{name}.png" for name in cli.FIGURES}
    assert {path.rpartition("/")[2] for path in status.TABLES} <= names["Tables"]
    for _, name, caption in found:
        assert len(caption) > 40 and "system-message" not in caption, name


def test_it_opens_without_errors_and_shows_a_figure(opened):
    from selenium.webdriver.support.ui import WebDriverWait

    wait = WebDriverWait(opened, 10)
    for place in ("//*[text()='Figures']", "//tr[td[text()='results/figures/front.png']]//a"):
        wait.until(lambda browser, place=place: browser.find_elements("xpath", place))[0].click()
    shown = "return Math.max(0, ...[...document.images].map(image => image.naturalWidth))"
    wait.until(lambda browser: browser.execute_script(shown) > 100)
    # Snakemake's own style sheet warns of what it is made with.
    assert [entry for entry in opened.get_log("browser") if entry["level"] == "SEVERE"] == []
