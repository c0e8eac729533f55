"""What an interval's width comes from, and the advice that follows: in closed form, and found."""

from __future__ import annotations

import numpy as np
import pytest
from making_identification import identify, pressed_leg

from legfem.inverse.comparison import total_of
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.estimates import Estimate, main_source, shares_of_error
from legfem.inverse.fit import value_of
from legfem.report.estimates import known_text
from legfem.report.kinds import page_of
from legfem.specimens.course import relaxation_parameters

DEEPER, LONGER = "press deeper", "use a longer cylinder, or solve this leg in 3D (--model 3d)"


def of_ends(sd: float) -> TabulatedCorrection:
    """Return a correction of -0.1 with an error (1) that is the same at all depths."""
    d = np.linspace(0.0, 25.0, 26)
    level = np.full((1, 1, 26), -0.1)
    return TabulatedCorrection("of a test", d, np.array([1e-3]), np.array([0.0]), level, {"length": np.full(26, sd)})


def test_shares_are_those_of_the_closed_form():
    x, p, white, gain, prior = np.linspace(0.1, 2.0, 30), 3.0, 0.2, 0.05, 0.5
    parts = {"recordings": white**2 * np.eye(30), "ends": gain**2 * p**2 * np.outer(x, x)}
    # Least squares with white weights and a prior: p = (x.y / white^2 + p0 / prior^2) / precision.
    precision = x @ x / white**2 + prior**-2
    followed = np.append(x / white**2, 1 / prior) / precision
    (shares,) = shares_of_error(followed[None], parts)
    squares = {"recordings": x @ x / white**2, "ends": (gain * p * x @ x / white**2) ** 2, "priors": prior**-2}
    whole = sum(squares.values())
    assert shares == pytest.approx({name: one / whole for name, one in squares.items()})
    assert main_source(shares) == "ends" and main_source({}) == "recordings"
    np.testing.assert_array_equal(total_of(parts), parts["recordings"] + parts["ends"])


@pytest.mark.parametrize(
    ("noise", "ends_sd", "said", "unsaid", "source"),
    [(0.01, 0.15, LONGER, DEEPER, "ends"), (3.0, 1e-3, DEEPER, LONGER, "recordings")],
)
def test_advice_is_what_narrows_the_interval(tmp_path, noise, ends_sd, said, unsaid, source):
    subject = pressed_leg(tmp_path, 0.9, 0.0, noise=noise)
    results = identify(subject, laws=("neo-hookean",), correction=of_ends(ends_sd))
    found = results[0].estimates["deep.C10"]
    assert found.identifiability == "weakly identifiable"
    assert main_source(found.error_shares) == source
    assert sum(found.error_shares.values()) == pytest.approx(1.0)
    advice = dict(page_of(results).headline.answers)["What to do"]
    assert said in advice and unsaid not in advice
    # What is advised against leaves the interval nearly as it was; what rules it, doesn't.
    better = {"ends": (noise / 3, ends_sd), "recordings": (noise, ends_sd / 3)}[source]
    again = pressed_leg(tmp_path, 0.9, 0.0, noise=better[0])
    (narrower,) = identify(again, laws=("neo-hookean",), correction=of_ends(better[1]))
    width = narrower.estimates["deep.C10"].standard_error / found.standard_error
    assert width == pytest.approx(1.0, abs=0.25)


def test_the_interval_of_a_number_without_a_unit_has_none():
    ratio = relaxation_parameters(300.0)[0]
    known = Estimate(ratio, 2.0, 0.1, (1.8, 2.2), "identifiable")
    assert known_text(value_of(known)) == "2.00 (1.80 to 2.20)"
