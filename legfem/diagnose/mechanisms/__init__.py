"""What a leg's model may leave out, one mechanism a class."""

from __future__ import annotations

from legfem.diagnose.mechanisms.base import (
    Mechanism,
    Parameter,
    Solution,
    TissueMechanism,
    Values,
)
from legfem.diagnose.mechanisms.instrument import ContactOnset, ForceDrift, SupportCompliance
from legfem.diagnose.mechanisms.muscle import MuscleContraction, Preconditioning
from legfem.diagnose.mechanisms.tissue import (
    Compressibility,
    ContactSlip,
    EndEffects,
    FasciaStiffness,
    IndenterTilt,
    PoroelasticDrainage,
    Prestress,
    StrainStiffening,
    SuperficialStiffness,
    SuperficialViscoelasticity,
    Viscoelasticity,
)

MECHANISMS: tuple[Mechanism, ...] = (
    StrainStiffening(),
    EndEffects(),
    Viscoelasticity(),
    SuperficialViscoelasticity(),
    PoroelasticDrainage(),
    Compressibility(),
    ContactSlip(),
    ContactOnset(),
    SupportCompliance(),
    ForceDrift(),
    MuscleContraction(),
    Preconditioning(),
    FasciaStiffness(),
    SuperficialStiffness(),
    IndenterTilt(),
    Prestress(),
)

__all__ = [
    "MECHANISMS",
    "EndEffects",
    "Mechanism",
    "Parameter",
    "Solution",
    "TissueMechanism",
    "Values",
    "Viscoelasticity",
]
