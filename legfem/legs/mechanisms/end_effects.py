"""The cylinder is short."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Mechanism, Stiffness, TissueResponses, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.correction import TabulatedCorrection


def _error(name: str, statement: str) -> Parameter:
    prior = Prior(0.0, 1.0, "linear", "the correction's own errors")
    return Parameter(name, "sd", (-3.0, 3.0), prior, statement=statement)


@dataclass(frozen=True)
class EndEffects(Mechanism):
    r"""The cylinder's ends: force times :math:`1 - s (P(d) + \sum_k a_k p_k(d))`.

    P is the idealised leg's correction, and :math:`p_k` its errors' modes: of the leg's effective
    length, which nobody knows, of the mesh that P was calibrated on, and of where contact begins.
    They are standard deviations, so each :math:`a_k` is known to one beforehand.

    Parameters
    ----------
    correction
        P of the leg; the recordings can't show the ends without it.
    """

    correction: TabulatedCorrection | None = None

    name: ClassVar[str] = "end-effects"
    statement: ClassVar[str] = "the cylinder is short: tissue moves along the leg and its ends carry force"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("scale", "-", "of the idealised leg's correction P(d)", 1.0, (0.0, 3.0)),
        _error("leg_length", "P's error for the leg's unknown length"),
        _error("calibration", "P's error by the mesh it was found on"),
        _error("first_contact", "P's error where contact begins"),
    )
    MODES: ClassVar[Mapping[str, str]] = {
        "leg_length": "leg length",
        "calibration": "mesh",
        "first_contact": "first contact",
    }
    """Names of the correction's errors by parameter."""
    would_be: ClassVar[str] = "ends of the cylinder that count {} times what is usual"
    next_experiment: ClassVar[str] = "repeat with a cylinder of twice the length"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there is a correction."""
        return "there is no 3D correction for this leg" if self.correction is None else None

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return the correction as it was calibrated."""
        return ({"scale": 0.5, **dict.fromkeys(self.MODES, 0.0)},)

    def for_length(self, values: Values, factor: float) -> Values:
        """Return a smaller share of the correction: a longer cylinder's ends count less."""
        return {**values, "scale": values["scale"] / factor}

    def relative_change(
        self, values: Values, at: Stiffness, observed: Observations, responses: TissueResponses
    ) -> FloatArray:
        """Return the share of the idealised leg's correction (n,).

        Raises
        ------
        ValueError
            Without a correction.
        """
        correction = self.correction
        if correction is None:
            raise ValueError("there is no 3D correction")
        d = observed.displacement
        c10, c20 = (np.asarray(value) for value in at)
        P = correction.correction(d, c10, c20)
        for name, mode in self.MODES.items():
            if mode in correction.errors:
                P = P + values[name] * np.interp(d, correction.displacement, correction.errors[mode])
        return np.asarray(-values["scale"] * P)
