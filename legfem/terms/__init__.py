"""Terms of a leg's model, one physical effect each.

Parameters are named ``<where>.<field>`` for what every leg has (``deep.C10``,
``contact.stiffness``) and ``<where>.<mechanism>.<field>`` for what a mechanism adds
(``deep.viscoelasticity.ratio``). A mechanism vanishes at its strength's null, the default.
"""

from legfem.terms.contraction import Contraction
from legfem.terms.drainage import Drainage
from legfem.terms.fascia import Fascia
from legfem.terms.normal_contact import NormalContact
from legfem.terms.pressure_stabilisation import PressureStabilisation
from legfem.terms.prestress import Prestress
from legfem.terms.skin_pressure import SkinPressure
from legfem.terms.stiffness_gradient import StiffnessGradient
from legfem.terms.tangential_contact import TangentialContact
from legfem.terms.tissue import Tissue
from legfem.terms.viscoelasticity import Viscoelasticity
from legfem.terms.volume_loss import VolumeLoss

__all__ = [
    "Contraction",
    "Drainage",
    "Fascia",
    "NormalContact",
    "PressureStabilisation",
    "Prestress",
    "SkinPressure",
    "StiffnessGradient",
    "TangentialContact",
    "Tissue",
    "Viscoelasticity",
    "VolumeLoss",
]
