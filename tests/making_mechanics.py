"""Small solids on which the mechanics is verified, and subject 3 of the reconstruction.

All use the three regions and laws of the default model, so that their forms are compiled once.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace

import basix.ufl
import numpy as np
from dolfinx import fem, mesh
from making import SHARED
from mpi4py import MPI

from legfem.experiments.plane_strain import Tissues
from legfem.fem.spaces import LegSpaces, build_spaces
from legfem.fem.system import System
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.legs.typical import Calf, calf_section
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.indenters import RigidCylinder
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.mechanics.model import LegModel, Term
from legfem.mechanics.terms import NormalContact, TangentialContact, Tissue
from legfem.meshing.section import BONE, DEEP, SKIN, SectionMeshSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import NewtonOutcome, SolveReport
from legfem.solve.protocol import Protocol
from legfem.solve.settings import NewtonSettings, StepSettings
from legfem.solve.stepping import follow
from studies.reconstruct import DEFINITION

FORMULATIONS = ("displacement", "mixed")
REAL_LEG = SHARED / "data" / "leg_geometry" / "cross_sections_5mm.csv"
COARSE = SectionMeshSettings(contact_size=2.5, growth=0.35, far_size=12.0, layer_size=5.0)


def fixed_steps(size: float) -> StepSettings:
    """Steps of one size, whatever Newton's method needs."""
    return StepSettings(first=size, largest=size, growth=100.0, easy=1000, hard=1001)


def press(
    system: System,
    solver: NewtonSolver,
    targets: Sequence[float],
    settings: StepSettings | None = None,
    on_step: Callable[[float], None] | None = None,
) -> SolveReport:
    """Press through displacements (mm) from an undeformed state, without a clock."""

    def tell(time: float, displacement: float) -> None:
        if on_step is not None:
            on_step(displacement)

    return follow(system, solver, Protocol.through(targets, rate=1.0), settings, tell)


# --- subject 3 ---


def subject_3() -> tuple[LegSection, Indenter, Tissues]:
    """Section, indenter and Table 5's parameters of subject 3."""
    shapes = tomllib.loads(DEFINITION.read_text())
    subject = shapes["subjects"]["3"]
    indenter = Indenter(15.0, 50.0, np.array(subject["aim_mm"]), subject["direction_deg"])
    tissues = Tissues(
        deep=ReducedPolynomial(0.70e-3, 28.0, C20=0.80e-3, D2=28.0),
        superficial=NeoHookean(2e-3, 22.5),
        fascia=NeoHookean(0.1, 22.5),
    )
    return calf_section(Calf(**subject["calf"])), indenter, tissues


# --- blocks and rings ---


def one_tissue(C10: float, D1: float, C20: float = 0.0) -> Tissues:
    """The three regions of the same tissue."""
    plain = NeoHookean(C10, D1)
    return Tissues(deep=ReducedPolynomial(C10, D1, C20=C20), superficial=plain, fascia=plain)


def solid(
    x: np.ndarray,
    y: np.ndarray,
    skin: Callable[[np.ndarray], np.ndarray],
    bone: Callable[[np.ndarray], np.ndarray],
    form: Callable[[np.ndarray], np.ndarray] | None = None,
    region: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[mesh.Mesh, mesh.MeshTags, mesh.MeshTags]:
    """Mesh a rectangle of triangles with corners at x and y.

    ``skin`` and ``bone`` mark facets by midpoint, before ``form`` (if any) moves the nodes;
    ``region`` gives the tag of cells by midpoint, `DEEP` otherwise.
    """
    made = mesh.create_rectangle(
        MPI.COMM_SELF, [[0, 0], [1, 1]], [len(x) - 1, len(y) - 1], diagonal=mesh.DiagonalType.right_left
    )
    nodes = made.geometry.x
    nodes[:, 0] = np.interp(nodes[:, 0], np.linspace(0, 1, len(x)), x)
    nodes[:, 1] = np.interp(nodes[:, 1], np.linspace(0, 1, len(y)), y)
    tagged = _tags(made, skin, bone, region)
    if form is not None:
        nodes[:, :2] = form(nodes[:, :2].copy())
    return made, *tagged


def ring(inner: float, outer: float, around: int, across: int) -> tuple:
    """A ring of triangles with its bone inside and its skin outside.

    Its polygons enclose the areas of the circles.
    """
    radius = inner * (outer / inner) ** np.linspace(0, 1, across + 1)
    angle = 2 * np.pi * np.arange(around) / around
    enclosing = np.sqrt(2 * np.pi / around / np.sin(2 * np.pi / around))
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    nodes = (enclosing * radius[:, None, None] * unit).reshape(-1, 2)
    i, j = np.meshgrid(np.arange(across), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    rising = (i + j) % 2 == 0
    first = np.where(rising, [a, c, d], [a, c, b])
    second = np.where(rising, [a, d, b], [b, c, d])
    cells = np.concatenate([first.reshape(3, -1).T, second.reshape(3, -1).T])
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    made = mesh.create_mesh(MPI.COMM_SELF, cells=cells.astype(np.int64), x=nodes, e=element)
    middle = 0.5 * (inner + outer)
    return made, *_tags(
        made, skin=lambda m: np.linalg.norm(m, axis=1) > middle, bone=lambda m: np.linalg.norm(m, axis=1) < middle
    )


def _tags(made, skin, bone, region=None) -> tuple[mesh.MeshTags, mesh.MeshTags]:
    made.topology.create_entities(1)
    made.topology.create_connectivity(1, 2)
    facets = mesh.exterior_facet_indices(made.topology)
    midpoints = mesh.compute_midpoints(made, 1, facets)
    tags = np.where(bone(midpoints), BONE, np.where(skin(midpoints), SKIN, 0))
    cells = np.arange(made.topology.index_map(2).size_local, dtype=np.int32)
    where = mesh.compute_midpoints(made, 2, cells)
    regions = np.full(len(cells), DEEP) if region is None else region(where)
    return (
        mesh.meshtags(made, 2, cells, regions.astype(np.int32)),
        mesh.meshtags(made, 1, facets[tags > 0], tags[tags > 0].astype(np.int32)),
    )


def block(
    x: np.ndarray | None = None, y: np.ndarray | None = None, **more
) -> tuple[mesh.Mesh, mesh.MeshTags, mesh.MeshTags]:
    """A rectangle with its skin above and its bone below; by default 40 mm x 20 mm under y = 0."""
    x = np.linspace(-20, 20, 21) if x is None else x
    y = np.linspace(-20, 0, 11) if y is None else y
    return solid(x, y, skin=lambda m: np.isclose(m[:, 1], y[-1]), bone=lambda m: np.isclose(m[:, 1], y[0]), **more)


def leg_model(
    tissues: Tissues,
    radius: float,
    contact: ContactSettings,
    penalty: float,
    formulation: str,
    mechanisms: Sequence[Term] = (),
) -> LegModel:
    """The default sum of terms, with the contact's stiffness (MPa/mm) as given, and more terms."""
    normal = NormalContact(RigidCylinder(radius), contact.pressure_law(penalty))
    model = LegModel(
        (
            Tissue("superficial", tissues.superficial),
            Tissue("fascia", tissues.fascia),
            Tissue("deep", tissues.deep),
            normal,
            TangentialContact(normal, contact.tangential_law(penalty)),
        ),
        formulation,
    )
    for term in mechanisms:
        model = model.with_term(term)
    return model


def pressed_block(
    formulation: str = "mixed",
    contact: ContactSettings | None = None,
    tissues: Tissues | None = None,
    radius: float = 8.0,
    penalty: float = 0.2,
    direction: tuple[float, float] = (0.0, -1.0),
    meshed: tuple | None = None,
    mechanisms: Sequence[Term] = (),
) -> System:
    """A block under a cylinder that touches it at the origin."""
    contact = contact or ContactSettings()
    tissues = tissues or one_tissue(1e-3, 28.0, C20=0.5e-3)
    spaces = build_spaces(*(meshed or block()), formulation)
    model = leg_model(tissues, radius, contact, penalty, formulation, mechanisms)
    return System(spaces, model, np.array([0.0, radius]), np.array(direction))


def free_of_contact(
    meshed: tuple, tissues: Tissues, formulation: str, mechanisms: Sequence[Term] = (), degree: int = 2
) -> System:
    """A solid with its indenter out of reach."""
    spaces = build_spaces(*meshed, formulation, degree)
    model = leg_model(tissues, 1.0, ContactSettings(), 1.0, formulation, mechanisms)
    return System(spaces, model, np.array([0.0, 1e3]), np.array([0.0, -1.0]))


def boundary_pinned(spaces: LegSpaces) -> LegSpaces:
    """The same spaces with the displacement prescribed on the whole boundary."""
    domain = spaces.mesh
    facets = mesh.exterior_facet_indices(domain.topology)
    nodes = fem.locate_dofs_topological(spaces.displacement_space, 1, facets)
    dofs = spaces.displacement_dofs.reshape(-1, spaces.dimension)[nodes].ravel()
    pressures = np.setdiff1d(spaces.pinned, spaces.displacement_dofs)
    return replace(spaces, pinned=np.concatenate([dofs, pressures]).astype(np.int32))


def nodal(system: System) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacement nodes' positions (n, 2) and their dofs (n, 2), bubbles included."""
    space = system.spaces.space
    if system.spaces.formulation != "displacement":
        space, dofs = space.sub(0).collapse()
    else:
        dofs = np.arange(len(system.unknown.x.array))
    position = fem.Function(space)
    position.interpolate(lambda x: x[:2])
    return position.x.array.reshape(-1, 2), np.asarray(dofs).reshape(-1, 2)


def solve_with_boundary(
    system: System,
    path: Callable[[np.ndarray, float], np.ndarray],
    increments: int = 1,
    wobble: float = 0.0,
    newton: NewtonSettings | None = None,
) -> NewtonOutcome:
    """Prescribe the pinned nodes' displacements along a path(x, share of the way).

    The other nodes start each increment from the same field; ``wobble`` (mm) of random noise takes
    them off it.
    """
    solver = NewtonSolver(system, newton)
    nodes, dofs = nodal(system)
    inside = ~np.isin(dofs, system.spaces.pinned)
    noise = wobble * np.random.default_rng(0).uniform(-1, 1, dofs.shape) * inside
    for k in range(increments):
        change = path(nodes, (k + 1) / increments) - path(nodes, k / increments)
        system.unknown.x.array[dofs] += change + noise
        outcome = solver.solve()
        if not outcome.converged:
            break
    return outcome


def at_skin(system: System, expression) -> np.ndarray:
    """Return a UFL expression of the skin at its quadrature points."""
    history = system.skin.history
    size = int(np.prod(expression.ufl_shape, dtype=int))
    values = history.values(history.expression(expression))
    return values.reshape(-1, size) if size > 1 else values


def contact_pressure(system: System) -> np.ndarray:
    """Return the contact pressure (MPa) at the skin's quadrature points."""
    return at_skin(system, system.model.term("contact").pressure(system.skin.domain))
