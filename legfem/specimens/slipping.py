"""Tests whose faces let the tissue slip."""

from __future__ import annotations

from dataclasses import replace

from legfem.experiments.axisymmetric import BallOnLayer, CylinderBetweenPlates
from legfem.experiments.flat_punch import PunchOnLayer
from legfem.experiments.lateral_cylinder import CylinderOnBlock
from legfem.experiments.suction import CupOnLayer
from legfem.specimens.sizes import FibrousTest, LayeredTest, OnLayers, Sizes


def slipping(sizes: Sizes) -> Sizes | None:
    """Return a test whose faces don't hold what they touch; None where they don't as stated."""
    free: Sizes
    match sizes:
        case LayeredTest():
            whole = slipping(sizes.whole)
            return replace(sizes, whole=whole) if isinstance(whole, OnLayers) else None
        case FibrousTest():
            within = slipping(sizes.whole)
            if within is None or isinstance(within, FibrousTest):
                return None
            return replace(sizes, whole=within)
        case BallOnLayer():
            free = replace(sizes, ball="frictionless")
        case PunchOnLayer():
            free = replace(sizes, punch="frictionless")
        case CylinderBetweenPlates():
            free = replace(sizes, ends="sliding")
        case CupOnLayer():
            free = replace(sizes, rim="sliding")
        case CylinderOnBlock():
            free = replace(sizes, cylinder="frictionless")
        case _:
            return None
    return None if free == sizes else free
