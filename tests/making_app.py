"""What one does in the app's pages in several tests."""

from __future__ import annotations

import browser

MINUTES = 60.0


def home(address):
    return address.split("?")[0]


def begun(page, text):
    """Begin with an example; return the name of its input."""
    page.click(text)
    page.until("location.pathname.startsWith('/input/')")
    page.sees("Is this what you measured?")
    return page.value("decodeURIComponent(location.pathname.split('/')[2])")


_UNEXPLAINED = """[...document.querySelectorAll('.q-field')].filter((field) => field.offsetParent
  && !field.querySelector('.q-field__messages')?.textContent.trim())
  .map((field) => field.querySelector('[aria-label]')?.getAttribute('aria-label'))"""


def accessible(page):
    """Whether axe-core finds nothing, and every field says beside it what it is."""
    assert page.inaccessible(browser.axe()) == []
    assert page.value(_UNEXPLAINED) == []
    return True
