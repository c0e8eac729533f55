"""The app from the first click to a verdict, in a browser without a network."""

import sys

import browser
import pytest
from walking import Server, walk

from legfem.common.errors import InputError
from legfem.subjects.subject import load_subject


@pytest.mark.slow
@pytest.mark.skipif(browser.browser() is None, reason="no Chromium here")
def test_a_folder_is_dropped_previewed_mapped_identified_and_diagnosed(tmp_path):
    server = Server((sys.executable,), tmp_path / "workspace")
    seen = walk(server, browser.browser(), tmp_path)
    assert "neo-hookean, C10 0." in seen["identified"]
    assert seen["diagnosed"].startswith("reduced-polynomial, C10 0.")
    assert "diagnose-example-leg" in seen["compared"]
    assert "no plain name" in seen["led out"]
    with pytest.raises(InputError) as refused:
        load_subject(tmp_path / "workspace" / "inputs" / "bad")
    assert seen["bad"] == str(refused.value)
    assert seen["faults"] == []
