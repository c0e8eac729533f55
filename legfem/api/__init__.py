"""The front door: ``import legfem as lf``, and a leg's folder becomes a result in one call.

Thin on the rooms: every function loads what it is given by id or path, runs what the command of its
name runs, and wraps what that found. What is found says more than the wrapper does; it stands in
its attributes.
"""

from legfem.api.diagnosed import DiagnosedFolder, DiagnosedLeg, diagnose
from legfem.api.identification import identify
from legfem.api.leg_in_stocking import LegInStocking, stocking
from legfem.api.loading import load_leg, load_sites, load_specimen, load_subject
from legfem.api.results import Identified

__all__ = [
    "DiagnosedFolder",
    "DiagnosedLeg",
    "Identified",
    "LegInStocking",
    "diagnose",
    "identify",
    "load_leg",
    "load_sites",
    "load_specimen",
    "load_subject",
    "stocking",
]
