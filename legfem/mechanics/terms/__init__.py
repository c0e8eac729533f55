"""Terms of a leg's model, one physical effect each.

Parameters are named ``<where>.<field>`` for what every leg has (``deep.C10``,
``contact.stiffness``) and ``<where>.<mechanism>.<field>`` for what a mechanism adds
(``deep.viscoelasticity.ratio``). A mechanism vanishes at its strength's null, the default.
"""

from legfem.mechanics.terms.contact import BoneSprings, NormalContact, SkinPressure, TangentialContact
from legfem.mechanics.terms.drainage import Drainage
from legfem.mechanics.terms.membranes import Fascia, Prestress
from legfem.mechanics.terms.muscle import Contraction, Fibres
from legfem.mechanics.terms.nonuniform_stiffness import StiffLump, StiffnessGradient, UnevenStiffness
from legfem.mechanics.terms.sliding import SlidingFace
from legfem.mechanics.terms.tissue import PressureStabilisation, Tissue, VolumeLoss
from legfem.mechanics.terms.viscoelasticity import Viscoelasticity

__all__ = [
    "BoneSprings",
    "Contraction",
    "Drainage",
    "Fascia",
    "Fibres",
    "NormalContact",
    "PressureStabilisation",
    "Prestress",
    "SkinPressure",
    "SlidingFace",
    "StiffLump",
    "StiffnessGradient",
    "TangentialContact",
    "Tissue",
    "UnevenStiffness",
    "Viscoelasticity",
    "VolumeLoss",
]
