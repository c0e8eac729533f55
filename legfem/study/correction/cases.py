"""Both models of one idealised leg, pressed and compared; outcomes are kept for a rerun."""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.experiments.indenter_pose import Cylinder
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.fem.compat import evaluate
from legfem.inverse.correction import smooth_ratio
from legfem.jobs.store import Store
from legfem.mechanics.materials import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.mechanics.terms import Fibres, NormalContact
from legfem.mechanics.terms.muscle import USUAL_EXTENSION
from legfem.meshing.structured import IdealisedLeg
from legfem.solve.path import ForceCurve


@dataclass(frozen=True)
class Material:
    """The paper's tissues; the deep one is neo-Hookean where ``C20_kPa`` is zero.

    ``fibre_ratio`` is that of the deep tissue's shear moduli along the leg and across, and
    ``fibre_extension`` what `legfem.mechanics.terms.Fibres` takes as extension over its shear.
    """

    C10_kPa: float = 2.0
    C20_kPa: float = 0.0
    D_per_MPa: float = 28.0
    superficial_C10_kPa: float = 2.0
    fascia_C10_kPa: float = 100.0
    outer_D_per_MPa: float = 22.5
    fibre_ratio: float = 1.0
    fibre_extension: float = USUAL_EXTENSION

    @property
    def stiffness(self) -> FloatArray:
        """C10 and C20 of the deep tissue, (2,), MPa."""
        return kpa_to_mpa(np.array([self.C10_kPa, self.C20_kPa]))

    @property
    def laws(self) -> dict[str, Hyperelastic]:
        """Law of every region."""
        c10, c20 = map(float, self.stiffness)
        deep = ReducedPolynomial(c10, self.D_per_MPa, c20, self.D_per_MPa if c20 else float("inf"))
        outer = {
            name: NeoHookean(kpa_to_mpa(stiffness), self.outer_D_per_MPa)
            for name, stiffness in (("superficial", self.superficial_C10_kPa), ("fascia", self.fascia_C10_kPa))
        }
        return {"deep": deep, **outer}

    @property
    def mechanisms(self) -> tuple[Fibres, ...]:
        """What is added to the laws."""
        if self.fibre_ratio == 1.0:
            return ()
        fibres = Fibres.of_ratio("deep", float(self.stiffness[0]), self.fibre_ratio)
        return (replace(fibres, extension=self.fibre_extension * fibres.shear),)


@dataclass(frozen=True)
class CorrectionCase:
    """One leg, one cylinder, one material, one mesh."""

    leg: IdealisedLeg = field(default_factory=IdealisedLeg)
    cylinder: Cylinder = field(default_factory=Cylinder)
    material: Material = field(default_factory=Material)
    settings: IdealisedLegSettings = field(default_factory=IdealisedLegSettings)
    depth: float = 25.0
    """mm."""

    def __post_init__(self) -> None:
        """Check that the cylinder stays off the bone."""
        if self.depth >= self.leg.depth_to_bone:
            problem = f"the cylinder would meet the bone, which lies {self.leg.depth_to_bone:g} mm deep, "
            problem += f"before {self.depth:g} mm"
            raise InputError("correction", "depth", problem, "press less deep, or make the bone smaller or deeper")

    @property
    def displacement(self) -> FloatArray:
        """Displacements (mm) at which P is tabulated: every half a millimetre."""
        return np.linspace(0, self.depth, round(2 * self.depth) + 1)

    @property
    def asked(self) -> "CorrectionCase":
        """What the outcome depends on: any linear solver finds the same."""
        return replace(self, settings=replace(self.settings, linear=_ANY_SOLVER))


_ANY_SOLVER = IdealisedLegSettings().linear


@dataclass(frozen=True, eq=False)
class CaseOutcome:
    """The two curves, and the pressure on the skin at the end."""

    spatial: ForceCurve
    plane: ForceCurve
    complete: bool
    reached: float
    """Displacement (mm) that both reached."""
    unknowns: int
    softened: bool
    """Whether a contact had to be softened to get there."""
    factorisations: int
    seconds: float
    """Time of the processor, s."""
    balance: float
    """Error of the balance of forces along the travel, relative to the force."""
    skin: FloatArray = field(default_factory=lambda: np.empty((0, 7)))
    """Skin of the 3D model at the end: reference and deformed position (mm), pressure (kPa)."""

    def P(self, displacement: FloatArray) -> FloatArray:
        """P at displacements (mm), (n,)."""
        return smooth_ratio(self.spatial, self.plane, displacement)


def solve_case(case: CorrectionCase, comm: MPI.Intracomm = MPI.COMM_SELF, keep_in: Path | None = None) -> CaseOutcome:
    """Solve both models; collective over the communicator.

    States of the 3D model are kept in a folder, if one is given, until it is solved.
    """
    started = time.process_time()
    material = case.material
    # The section is small: every rank solves all of it.
    flat = IdealisedLegIndentation(
        case.leg, case.cylinder, material.laws, 2, case.settings, mechanisms=material.mechanisms
    )
    experiment = IdealisedLegIndentation(
        case.leg, case.cylinder, material.laws, 3, case.settings, comm, material.mechanisms
    )
    plane = flat.solve(depth=case.depth)
    spatial = experiment.solve(depth=case.depth, keep_in=keep_in)
    balance = experiment.system.balance()
    # The mirror planes take nothing along the travel.
    unbalanced = abs(balance.contact_force[1] + balance.bone_reaction[1])
    return CaseOutcome(
        spatial.curve,
        plane.curve,
        plane.report.complete and spatial.report.complete,
        min(plane.curve.depth, spatial.curve.depth),
        spatial.report.unknowns,
        any(solved.report.contact_stiffness_factor < 1 for solved in (plane, spatial)),
        spatial.report.factorisations,
        time.process_time() - started,
        float(unbalanced / abs(balance.contact_force[1])),
        skin_state(experiment),
    )


def skin_state(experiment: IdealisedLegIndentation) -> FloatArray:
    """Return position before and after (mm) and pressure per reference area (kPa), (n, 2 dim + 1).

    At the skin's quadrature points, gathered on all ranks.
    """
    system = experiment.system
    domain = system.skin.domain
    normal = next(t for t in system.model.at("skin") if isinstance(t, NormalContact))
    both = [*domain.position, *(domain.position + domain.displacement), normal.pressure(domain)]
    mesh = system.spaces.skin
    cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    compiled = system.skin.history.expression(ufl.as_vector(both))
    local = evaluate(compiled, mesh, cells).reshape(-1, len(both))
    local[:, -1] = mpa_to_kpa(local[:, -1])
    return np.concatenate(experiment.comm.allgather(local))


def remembered_case(folder: Path, case: CorrectionCase, comm: MPI.Intracomm = MPI.COMM_SELF) -> CaseOutcome:
    """Return a case's outcome, from a folder if it is there, else solved and kept if complete."""
    store = Store(folder, CaseOutcome, modules=(__name__,))
    states = folder / f"{store.key(case.asked)}-states"
    return store.get_or_make(
        case.asked, lambda: solve_case(case, comm, states), comm, worth=lambda outcome: outcome.complete
    )
