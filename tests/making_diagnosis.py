"""A leg's responses in closed form and recordings of it, for tests of the diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.diagnose.mechanisms import TissueMechanism, Values
from legfem.diagnose.noise import Noise, error_model
from legfem.diagnose.observations import Observations, observe
from legfem.diagnose.predict import Predictor
from legfem.protocol import Protocol
from legfem.recording import Instrument, Recording
from legfem.units import FloatArray

INSTRUMENT = Instrument(force_sd=0.03, displacement_sd=0.01)
NOISE = Noise(0.02, 0.02, 12.0, 0.02, 0.008, 0.0, "made")


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Responses of no leg in particular: forces of a second and a fourth power."""

    grid: FloatArray
    c10_bounds: tuple[float, float] = (0.05, 20.0)
    c20_bounds: tuple[float, float] = (0.0, 20.0)

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the force (N)."""
        x = self.grid / 20
        return 10 * (c10 * (x + x**2) + 0.3 * x + 2.0 * c20 * x**4)

    def relative_change(
        self,
        mechanism: TissueMechanism,
        values: Values,
        c10: float,
        c20: float,
        observed: Observations,
    ) -> FloatArray:
        """Return shapes that differ from mechanism to mechanism."""
        x = observed.displacement / 20
        strength = next(iter(values.values()))
        if mechanism.name == "viscoelasticity":
            tau = values["relaxation_time"]
            change = np.empty(len(x))
            for number, stations in enumerate(observed.protocols):
                here = observed.protocol == number
                t = observed.time[here]
                d = observed.displacement[here]
                fine = np.linspace(0, t.max(), 4000)
                rate = np.gradient(stations.protocol.displacement_at(fine), fine)
                kernel = np.array([np.trapezoid(rate * np.exp(-np.maximum(s - fine, 0) / tau)
                                                * (fine <= s), fine) for s in t])  # fmt: skip
                change[here] = kernel / np.maximum(d, 1e-9)
            return strength * change
        shapes = {
            "strain-stiffening": x**6,
            "compressibility": -0.1 * np.exp(-3 * x),
            "fascia-stiffness": 0.1 * np.cos(2 * x),
            "superficial-stiffness": 0.2 * np.exp(-8 * x),
            "indenter-tilt": 0.002 * np.sin(6 * x),
        }
        return strength * shapes.get(mechanism.name, np.zeros(len(x)))


def two_rates() -> list[Recording]:
    """Return noiseless recordings of nothing: three repeats at each of two rates."""
    return [
        _blank(Protocol.cycle(20.0, rate, hold=60.0), f"rate{rate:g}_{k}")
        for rate in (0.4, 2.0)
        for k in (1, 2, 3)
    ]


def ramps() -> list[Recording]:
    """Return noiseless recordings of nothing: three slow loadings."""
    return [_blank(Protocol.ramp(20.0, 0.4), f"trial{k}") for k in (1, 2, 3)]


def _blank(protocol: Protocol, name: str) -> Recording:
    time = np.arange(0, protocol.duration + 1e-9, 0.1)
    return Recording(time, protocol.displacement_at(time), np.zeros(len(time)), name)


def observations(recordings: list[Recording]) -> tuple[Observations, Predictor]:
    """Return empty observations with a predictor for them."""
    observed = observe(recordings, INSTRUMENT, starts_at_contact=True)
    responses = ClosedForm(np.arange(0.5, 20.6, 0.5))
    return observed, Predictor(observed, responses, "reduced-polynomial")


def noisy(observed: Observations, force: FloatArray, seed: int) -> tuple[Observations, FloatArray]:
    """Return observations of a force with drawn errors, and the errors."""
    true = observed.with_force(force)
    errors = error_model(true, NOISE).draw(1, np.random.default_rng(seed))[0]
    return true.with_force(force + errors), errors
