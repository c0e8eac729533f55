"""What one standard deviation of each thing that isn't known exactly of a body does to its readings.

The effect is the relative change of the force by one, from a solution with another geometry, or from the exact
derivative by an assumed number; of the correction for ends it is the error that comes with it.
"""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray
from legfem.inverse.accuracy import GEOMETRY_DOF, MATERIAL_DOF, SIZE, Accuracy, Cause, word_of
from legfem.inverse.errors import NuisanceEffect
from legfem.inverse.library import NuisanceChanges
from legfem.inverse.mechanism import Stiffness
from legfem.inverse.observations import Observations

if TYPE_CHECKING:
    from legfem.inverse.correction import TabulatedCorrection


def nuisance_effects(
    changes: NuisanceChanges,
    observed: Observations,
    prediction: FloatArray,
    accuracy: Accuracy,
    ends: "TabulatedCorrection | None" = None,
    stiffness: Stiffness = (1e-3, 0.0),
) -> list[NuisanceEffect]:
    """Return what one standard deviation of each thing that isn't known exactly does to the readings.

    Parameters
    ----------
    changes
        Of the body's elastic courses.
    observed
        The recordings.
    prediction
        (N,): by the model.
    accuracy
        Of what is known of the body.
    ends
        The correction for the cylinder's ends, whose errors count where it is applied.
    stiffness
        C10 and C20, MPa: of the correction.
    """
    d, force = observed.displacement, prediction[: len(observed.force)]

    def along(of: NuisanceChanges) -> dict[str, FloatArray]:
        rows = {**of.geometric, **of.material}
        stacked = np.reshape(list(rows.values()), (len(rows), len(of.grid)))
        every = CubicSpline(of.grid, stacked, axis=1)(np.maximum(d, of.grid[0]))
        return dict(zip(rows, every, strict=True))

    of_force = along(changes)

    @cache
    def of_course(course: str) -> dict[str, FloatArray]:
        return along(changes.channels[course])

    @cache
    def effect(name: str) -> FloatArray:
        further = [one.read(lambda course: of_course(course)[name]) for one in observed.channels]
        return np.concatenate([force * of_force[name], *further])

    found: list[NuisanceEffect] = []
    for name in changes.material:
        if (sd := accuracy.log_sd(name)) > 0:
            word = word_of(name)
            degrees = GEOMETRY_DOF if name.startswith(SIZE) else MATERIAL_DOF
            found.append(NuisanceEffect(word, sd * effect(name), Cause(word, degrees)))
    for error in accuracy.shape_errors:
        if error.weights.keys() <= changes.geometric.keys():
            moved = np.array(list(error.weights.values())) @ np.array([effect(name) for name in error.weights])
            found.append(NuisanceEffect(error.name, moved, error.cause))
    if ends is not None:
        for mode_name, mode in ends.relative_errors(d, *stiffness).items():
            relative = np.concatenate([mode, *(one.weights @ (one.follows_force * mode) for one in observed.channels)])
            name = f"3D correction: {mode_name}"
            found.append(NuisanceEffect(name, prediction * relative, Cause(name)))
    return found
