"""The tab of the studies in a real browser: run, cancel, see the picture, take the best rover."""

from collections.abc import Iterator

import pytest

from rover_planner.studies.example_studies import find_examples
from rover_planner.studies.runner import find_rover, run_study
from rover_planner.studies.study_file import load_study
from rover_planner.viewer.pages.page import Page
from support.viewer.browser import Visitor, needs_browser, wait_until
from support.viewer.sessions import held, session_on
from support.viewer.visits import open_browser

pytestmark = [needs_browser, pytest.mark.slow]


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    page = Page(session_on(lambda x, y: 0.0 * x), port=0)
    yield page
    page.close()


@pytest.fixture(scope="module")
def visitor(page) -> Iterator[Visitor]:
    with open_browser() as chromium:
        visitor = Visitor(chromium, page.url)
        visitor.open_tab("Studies")
        yield visitor


def test_a_study_that_runs_tells_its_progress_and_is_cancelled(visitor, page):
    visitor.choose("Study", "tallest_step")
    visitor.wait_for("rovers like lsr1 for the largest")
    with held(page.studies.work):
        visitor.press("Run the study")
        visitor.wait_for("trying rover")
        visitor.press("Cancel the study")
        visitor.wait_for("cancelled")
        assert page.studies.work.progress is None


def test_the_best_rover_of_a_study_is_taken_over(visitor, page):
    visitor.choose("Study", "level_load_shares")
    visitor.wait_for("optimise at most 200 rovers")
    visitor.press("Run the study")
    visitor.wait_for("finished")
    visitor.wait_for("best:")
    visitor.tab.locator("#study-answer").wait_for()
    study = load_study(find_examples()["level_load_shares"])
    result = run_study(study)
    best = find_rover(study, result.best)
    assert best != page.session.rover
    visitor.press("Show the best rover")
    wait_until(lambda: page.session.rover == best, "the best rover")
    assert page.session.finished.scenario.loaded == study.rover
    assert "lsr1 (changed)" in page.describe_context()[0].rover
    assert not visitor.page_errors
