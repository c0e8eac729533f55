"""Terms of a leg's model, one physical effect each.

Parameters are named ``<where>.<field>`` for what every leg has (``deep.C10``,
``contact.stiffness``) and ``<where>.<mechanism>.<field>`` for what a mechanism adds
(``deep.viscoelasticity.ratio``). A mechanism vanishes at its strength's null, the default.
"""

import mpi4py.MPI  # first, see legfem.fem

from legfem.mechanics.terms.contact import BoneSprings, NormalContact, SkinPressure, TangentialContact
from legfem.mechanics.terms.membranes import Fascia, Prestress, SlidingFace
from legfem.mechanics.terms.muscle import Excess, Fibres, StiffLump, StiffnessGradient, UnevenStiffness
from legfem.mechanics.terms.time_dependence import Drainage, Viscoelasticity
from legfem.mechanics.terms.tissue import PressureStabilisation, Tissue, VolumeLoss
