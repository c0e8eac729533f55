"""The front door: ``import legfem as lf``, and a leg's folder becomes a result in one call.

A function loads what it is given by id or path, does all that the command of its name does, and wraps what that found.
The commands call the functions of the modules here; those of the door itself name keywords where something is wrong.
"""

from legfem.api import cohorts, diagnosed, identification, leg_in_stocking, loading, planned
from legfem.api.arguments import front
from legfem.api.cohorts import Cohort
from legfem.api.diagnosed import DiagnosedFolder, DiagnosedLeg
from legfem.api.planned import PlannedTests
from legfem.api.results import Identification, IdentifiedLeg, IdentifiedSites, IdentifiedSpecimen, LegInStocking

cohort = front(cohorts.cohort)
diagnose = front(diagnosed.diagnose)
identify = front(identification.identify)
load_leg = front(loading.load_leg)
load_sites = front(loading.load_sites)
load_specimen = front(loading.load_specimen)
load_subject = front(loading.load_subject)
plan = front(planned.plan)
stocking = front(leg_in_stocking.stocking)

__all__ = [
    "Cohort",
    "DiagnosedFolder",
    "DiagnosedLeg",
    "Identification",
    "IdentifiedLeg",
    "IdentifiedSites",
    "IdentifiedSpecimen",
    "LegInStocking",
    "PlannedTests",
    "cohort",
    "diagnose",
    "identify",
    "load_leg",
    "load_sites",
    "load_specimen",
    "load_subject",
    "plan",
    "stocking",
]
