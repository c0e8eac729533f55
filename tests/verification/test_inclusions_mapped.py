"""Two inclusions in a muscle that another code pressed: found in images inside, and by the force alone not told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from making_inclusions import drawn, found_in, mapped, pressed_calf, without_images

from legfem.geometry.indenter import Site

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", [1, 2])
def test_both_are_found_within_5_mm_and_their_c10_lies_in_its_interval(seed: int, tmp_path: Path):
    case = drawn(seed)
    leg = pressed_calf(tmp_path / "leg", case, seed)
    found, told = mapped(leg)
    assert told.converged and len(told.stands_out) == 2
    middles = case.middles(Site(leg.section, leg.indenter))
    print([(told.points_mm[k], told.C10_kPa[k], told.log_sd[k]) for k in told.stands_out], middles)
    assert all(found_in(told, at, factor) == (True, True) for at, factor in zip(middles, case.factors, strict=True))
    page = found.write(tmp_path / "out").with_suffix(".html").read_text()
    assert "Stands out: C10" in page and "leaves of the readings inside" in page
    (law,) = json.loads((tmp_path / "out" / "result.json").read_text())["laws"].values()
    assert len(law["field"]["C10_kPa"]) == len(law["field"]["points_mm"]) == len(told.told)
    if seed == 1:
        alone = mapped(without_images(leg))[1]
        assert not alone.told.any() and not len(alone.stands_out)
