"""Derivatives by what a search is free in, of a model that is differentiated by numbers of its own."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.solve.path import ForceCurve

type Chain = Mapping[str, Mapping[str, float]]
"""Derivatives of the model's own parameters by each parameter that is asked for; full names."""


def needed_for(chain: Chain) -> tuple[str, ...]:
    """Return the model's own parameters by which it has to be differentiated."""
    return tuple(dict.fromkeys(name for row in chain.values() for name in row))


def through(chain: Chain, curve: ForceCurve) -> ForceCurve:
    """Return a curve with derivatives by what is asked for, of one with those of `needed_for`."""

    def summed(by: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        nothing = np.zeros_like(curve.displacement)
        return {
            asked: np.asarray(sum((weight * by[name] for name, weight in row.items()), nothing))
            for asked, row in chain.items()
        }

    channels = {name: summed(by) for name, by in curve.channel_sensitivities.items()}
    return replace(curve, sensitivities=summed(curve.sensitivities), channel_sensitivities=channels)
