"""What isn't known exactly of a leg beside its recordings: outlines, aim, direction, assumed tissues."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.section import layer_thicknesses
from legfem.inverse.accuracy import GEOMETRY_DOF, MATERIAL_DOF, MATERIAL_LOG_SD, Cause, word_of
from legfem.inverse.catalogue import IdentifiedLaw, Values
from legfem.inverse.errors import NuisanceEffect
from legfem.inverse.library import NuisanceChanges
from legfem.inverse.library_build import geometric_changes
from legfem.inverse.library_tasks import STIFFENING, rounded, stiffness_at
from legfem.inverse.linearised import nuisance_effects, of_recording
from legfem.inverse.mechanism import Stiffness
from legfem.inverse.readings import GAIN, OFFSET, ZERO
from legfem.inverse.settings import SearchRequest
from legfem.inverse.station_test import StationTest
from legfem.legs.finite_element_models import solved_responses
from legfem.legs.nuisances import ShapeAccuracy, accuracy_of_shape
from legfem.legs.subject import SitedLeg, Subject
from legfem.legs.typical import TYPICAL_LIMBS
from legfem.solve.path import ForceCurve

type Geometry = Callable[[int, Stiffness], NuisanceChanges | None]
"""Changes of the courses of a site, by its number, by outlines, aim and direction that are off, near a stiffness (MPa);
None where they aren't known."""


def unknown_geometry(site: int, stiffness: Stiffness) -> None:
    """Return nothing: no force of a closed form, or of a leg in 3D, is differentiated by its geometry."""


@dataclass(eq=False)
class SectionGeometry:
    """What errors of the geometry of a leg's sections do, solved on a coarse mesh when first asked for.

    Parameters
    ----------
    leg
        With its sites.
    tests
        One a site.
    request
        Where solves are kept, processes and progress.
    """

    leg: SitedLeg
    tests: Sequence[StationTest]
    request: SearchRequest
    _known: dict[int, NuisanceChanges] = field(default_factory=dict, init=False, repr=False)

    def __call__(self, site: int, stiffness: Stiffness) -> NuisanceChanges:
        """Return the changes at a site by each geometry, near the stiffness (MPa) that is asked for first."""
        if site not in self._known:
            subject, observed, request = self.leg.sites[site], self.tests[site].observed, self.request
            folder = request.responses or (None if request.out is None else request.out / "responses")
            centre = stiffness_at(rounded(stiffness[0]), STIFFENING[subject.tissues["deep"].law])
            _, responses = solved_responses(subject, observed, folder)
            self._known[site] = geometric_changes(responses, observed, centre, request.jobs, request.progress)
        return self._known[site]


def unknowns_at(
    test: StationTest,
    subject: Subject,
    curve: ForceCurve,
    values: Values,
    changes: NuisanceChanges | None,
    law: IdentifiedLaw,
    own_errors: Values,
) -> Iterator[NuisanceEffect]:
    """Yield what one standard deviation of each thing that isn't known exactly does to all of a site's readings.

    Parameters
    ----------
    test
        The site's recordings, about the solve.
    subject
        The leg as it was pressed there.
    curve, values
        A solve near the optimum, with its derivatives.
    changes
        By errors of the geometry.
    law
        What is free in it isn't assumed.
    own_errors
        Standard deviations of the site's own instrument, by full name.
    """
    accuracy, predicted = accuracy_of_shape(subject), test.every_reading(curve, values)
    told = test.observed.with_values(predicted)
    every, rates = {**law.nominal, **values}, test.derivatives(curve, values)
    for name in MATERIAL_LOG_SD:
        sd = accuracy.log_sd(name)
        if name in rates and name not in law.names and sd > 0:
            word, effect = word_of(name), sd * every[name] * rates[name]
            yield NuisanceEffect(word, effect, Cause(word, MATERIAL_DOF), "assumed", True)
    yield from (
        [*_of_shape(test, subject, predicted, accuracy), *of_recording(told, accuracy)]
        if changes is None
        else nuisance_effects(changes, test.observed, predicted, accuracy)
    )
    # On a rig that yields a leg seems to stiffen less.
    lost = told.beside(accuracy.rig_sd * told.force)
    yield NuisanceEffect("rig", lost * told.by_displacement, Cause("rig"), "rig", shared=True)
    force: FloatArray = np.where(np.arange(len(predicted)) < len(test.observed.force), 1.0, 0.0)
    if subject.typical_shape:
        shape, sd = Cause("typical shape", GEOMETRY_DOF), TYPICAL_LIMBS[subject.typical_shape].force_sd
        yield NuisanceEffect(shape.name, sd * force * predicted, shape)
    by_instrument = {GAIN: force * predicted, ZERO: force, OFFSET: test.by_displacement}
    for name, sd in own_errors.items():
        yield NuisanceEffect(name, sd * by_instrument[name], Cause(name), "recordings")


def _of_shape(
    test: StationTest, subject: Subject, predicted: FloatArray, accuracy: ShapeAccuracy
) -> Iterator[NuisanceEffect]:
    """Yield what outlines do where no derivatives by them are known.

    A thickness that is off at rest is so in proportion all along the test.
    """
    at_rest = layer_thicknesses(subject.section, subject.indenter.aim, subject.indenter.direction)
    for one, span in zip(test.observed.channels, test.observed.data.spans[1:], strict=True):
        if one.name in at_rest and accuracy.contour_sd > 0:
            effect = np.zeros(len(predicted))
            # A thickness lies between two outlines.
            effect[span] = np.sqrt(2) * accuracy.contour_sd * predicted[span] / at_rest[one.name]
            yield NuisanceEffect(f"outlines about the {one.kind.title}", effect, Cause("outlines", GEOMETRY_DOF))
