"""The experiments on a subject's leg: its section in plane strain, and its shape in 3D."""

import math
from collections.abc import Sequence

from mpi4py import MPI

from legfem.experiments.indentation_3d import Cylinder
from legfem.experiments.indenter_pose import Ball, Indenting, Pose, Punch
from legfem.experiments.leg_3d import LegIndentation3D, SolidLegSettings, fibres_of, membrane_of
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.geometry.indenter import Indenter
from legfem.geometry.leg_shape_motion import without_layer
from legfem.legs.placement import SpatialLeg
from legfem.legs.subject import Subject, TissueParameters
from legfem.mechanics.materials import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.mechanics.model import Term


def tissues_of(subject: Subject) -> Tissues:
    """Return the laws of a subject's tissues; what is to be identified stands at 1 kPa.

    The deep tissue is a reduced polynomial: with ``C20 = 0`` and ``D2 = inf`` it is neo-Hookean.
    """
    given = subject.tissues
    deep = given["deep"]
    return Tissues(
        deep=ReducedPolynomial(
            C10=1e-3 if deep.C10 is None else deep.C10,
            D1=deep.D1,
            C20=deep.C20 or 0.0,
            D2=math.inf if deep.D2 is None else deep.D2,
        ),
        superficial=_law(given["superficial"]),
        fascia=_law(given["fascia"]),
    )


def _law(given: TissueParameters) -> Hyperelastic:
    if given.C10 is None:
        raise ValueError("only the deep tissue's stiffness is identified")
    if given.law == "neo-hookean":
        return NeoHookean(given.C10, given.D1)
    second = math.inf if given.D2 is None else given.D2
    return ReducedPolynomial(given.C10, given.D1, given.C20 or 0.0, second)


def plane_strain_test(
    subject: Subject,
    settings: PlaneStrainSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    mechanisms: Sequence[Term] = (),
) -> PlaneStrainIndentation:
    """Return the cylinder pressed into a subject's section; the deep tissue's law covers both of the paper's."""
    settings = settings or PlaneStrainSettings()
    tissues, sights = tissues_of(subject), subject.sights
    return PlaneStrainIndentation(subject.section, subject.indenter, tissues, settings, comm, mechanisms, sights=sights)


def spatial_test(
    subject: Subject, leg: SpatialLeg, settings: SolidLegSettings | None = None, comm: MPI.Intracomm = MPI.COMM_SELF
) -> LegIndentation3D:
    """Return the indenter pressed into a subject's leg in 3D; see `legfem.legs.placement.spatial_leg`.

    The fascia's layer has no thickness here, and between soft tissues it doesn't yield across
    it: it is taken out of the leg, so that fat and muscle are as thick as they are.
    """
    given, tissues, fibres = subject.indenter, tissues_of(subject), subject.fibres
    thickness = subject.section.fascia_thickness
    aim = float(given.aim[0]), float(given.aim[1])
    return LegIndentation3D(
        without_layer(leg.shape, thickness),
        _indenting(given),
        Pose(aim, 0.0, given.direction_deg, given.axis_deg),
        {"deep": tissues.deep, "superficial": tissues.superficial},
        membrane_of(tissues.fascia, thickness),
        settings or SolidLegSettings(),
        comm,
        () if fibres is None else (fibres_of(tissues.deep.C10, fibres.value),),
    )


def _indenting(given: Indenter) -> Indenting:
    if given.shape == "ball":
        return Ball(given.radius)
    kind = Punch if given.shape == "punch" else Cylinder
    return kind(given.radius, given.length)
