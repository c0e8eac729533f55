"""A site of a leg: its recordings at their stations as a test, and the mean loading curve that people are shown."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from legfem.channels.kinds import CHANNELS
from legfem.common.errors import Argument, InputError
from legfem.data import LoadingCurve, mean_loading_curve
from legfem.data.contact import LEG
from legfem.inverse.catalogue import Values
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.fit import TestFit
from legfem.inverse.observations import observe
from legfem.inverse.parameter import Parameter
from legfem.inverse.readings import OFFSET, Channel
from legfem.inverse.station_test import StationTest, rows_of
from legfem.legs.subject import Subject


@dataclass(frozen=True, eq=False)
class SiteFit(TestFit):
    """A site beside the fit."""

    curve: LoadingCurve = field(kw_only=True)
    """Mean of the trials' loading."""


def site_test(
    subject: Subject,
    depth: float | None,
    correction: TabulatedCorrection | None = None,
    model: str = "2d",
    loading_alone: bool = False,
) -> StationTest:
    """Return a site's recordings as a test.

    Parameters
    ----------
    subject
        The leg as it was pressed there.
    depth
        Greatest displacement that counts, mm.
    correction
        Of the force in plane strain for the cylinder's ends.
    model
        ``2d`` or ``3d``, which gives the channels that count.
    loading_alone
        See `legfem.inverse.station_test.rows_of`.

    Raises
    ------
    InputError
        If a recording has no loading.
    """
    found = observe(subject.trials)
    observed = replace(found, channels=tuple(one for one in found.channels if model in CHANNELS[one.name].models))
    return StationTest(subject.site or "leg", observed, rows_of(observed, depth, loading_alone), correction)


def measured_curve(subject: Subject, depth: float | None = None) -> LoadingCurve:
    """Mean loading curve of a subject's trials, down to a depth (mm) at most.

    Raises
    ------
    InputError
        If the depth leaves too little to identify from.
    """
    curve = mean_loading_curve(subject.trials)
    if depth is None:
        return curve
    if not depth >= LEG.depth:
        problem = "is too shallow to identify a stiffness from"
        raise InputError(Argument("depth"), f"{depth:g} mm", problem, f"give at least {LEG.depth:g} mm")
    return curve.down_to(depth)


def beyond_of(parameters: Sequence[Parameter], fixed: Values) -> float:
    """How far (mm) a model is to be pressed beyond the measured curve.

    Contact that began before the recording's zero takes the indenter deeper than it says.
    """
    least = fixed.get(OFFSET, 0.0)
    for one in parameters:
        if one.name == OFFSET:
            least = min(least, one.bounds[0])
    return max(0.0, -least)


def curve_of(one: TestFit) -> LoadingCurve:
    """Mean loading curve of a site."""
    assert isinstance(one, SiteFit)
    return one.curve


def mean_force(curve: LoadingCurve) -> Channel:
    """Mean force (N) along the displacement after first contact (mm), as results show it."""
    return Channel("force", "N", curve.displacement, "displacement_mm", curve.force, curve.force_sd)
