"""Errors of a specimen's sizes, which its force follows: by full solves of a body a little larger."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values
from legfem.specimens.comparison import SpecimenComparison
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.sizes import Sizes, kind_in, lengths_of, resized

_RESIZED = 0.03
"""Relative step by which the force's change with a size is found."""


def size_covariance(
    comparison: SpecimenComparison,
    model: SpecimenForward,
    values: Values,
    readings: FloatArray,
    predicted: FloatArray,
    relative_sd: Mapping[Sizes, Mapping[str, float]],
) -> FloatArray:
    """Return the covariance (n, n), N2, of predicted forces by the sizes' errors, each a specimen's own.

    Parameters
    ----------
    comparison
        Recordings of n stations.
    model
        Of their tests.
    values, readings
        At the optimum.
    predicted
        (n,), N, there.
    relative_sd
        Relative errors of sizes by name, of every test.
    """
    found = np.zeros((len(predicted), len(predicted)))
    specimens = np.repeat(
        [part.recording.specimen for part in comparison.parts], [len(part.course.time) for part in comparison.parts]
    )
    numbers = np.repeat([part.test for part in comparison.parts], [len(part.course.time) for part in comparison.parts])
    for number, sizes in enumerate(model.tests):
        for name, sd in relative_sd[sizes].items():
            if not sd:
                continue
            if name in kind_in(sizes).as_force:
                change = predicted
            else:
                larger = resized(sizes, name, (1 + _RESIZED) * lengths_of(sizes)[name])
                tests = tuple(larger if one == sizes else one for one in model.tests)
                outcome = replace(model, tests=tests).solve(values, ())
                if not outcome.complete or not comparison.reached_by(outcome):
                    continue
                change = (comparison.predict(outcome, readings).values - predicted) / _RESIZED
            for specimen in dict.fromkeys(specimens):
                mode = sd * np.where((specimens == specimen) & (numbers == number), change, 0.0)
                found += np.outer(mode, mode)
    return found
