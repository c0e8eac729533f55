"""Reports as the commands write them, in a browser without a network."""

import browser
import pytest
from driving import DRAWN, Driven
from test_web_pages import MOST_BYTES, MOST_SECONDS
from typer.testing import CliRunner

from legfem.commands.identify import app

pytestmark = [pytest.mark.slow, pytest.mark.skipif(browser.browser() is None, reason="no Chromium here")]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Return the page of subject 3 as `legfem.identify --subject 3` makes it."""
    out = tmp_path_factory.mktemp("identify-3")
    done = CliRunner().invoke(app, ["--subject", "3", "--out", str(out), "--jobs", "1"])
    assert done.exit_code == 0, done.output
    return out / "report.html"


def test_the_report_of_subject_3_is_light_opens_quickly_and_asks_for_nothing(report):
    assert report.stat().st_size < MOST_BYTES
    with Driven(browser.browser()) as page:
        opened = min(page.seconds_to_open(report.as_uri()) for _ in range(3))
        assert opened < MOST_SECONDS
        assert page.faults == []
        first = page.value("document.querySelector('.sentence').getBoundingClientRect().bottom")
        page.resize(390, 844)
        page.open(report.as_uri())
        phone = page.until("document.querySelector('.sentence')?.getBoundingClientRect().bottom")
        assert max(first, phone) < 600, "the verdict stands on the first screen"
        page.until(DRAWN)
        beyond = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert page.value(beyond) == 0, "nothing is wider than a phone"


@pytest.mark.parametrize("width", [1000, 500])
def test_the_report_of_subject_3_has_no_fault_and_its_controls_work(report, width):
    seen = browser.seen(report, browser.browser(), browser.axe(), width)
    assert browser.faults(seen) == [] and "inaccessible" in seen
    assert browser.idle(seen) == []
    assert {"off", "cursor", "pictures"} <= seen.keys(), "there are curves and a leg to press"
