"""Newton's method for one step: a thin wrapper of PETSc's SNES.

The wrapper adds three things to SNES. The tangent is assembled and factorised anew only while that pays: an iteration
that went well is followed by one with the same factors, and after an easy step the next one's first tangent may take
the body's part from the last before. An update is shortened until every J is positive and the residual is acceptable.
The outcome is a value, and a state is accepted only where the residual is small; SNES' test on the length of the update
is off, since it accepts impossible steps.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from legfem.common.units import FloatArray
from legfem.fem.compat import RESIDUAL_NOT_FINITE
from legfem.fem.spaces import sum_over
from legfem.fem.system import System
from legfem.solve.linear import LinearSettings, SaddlePreconditioner, configure, prepare, renew_factors
from legfem.solve.path import NewtonOutcome
from legfem.solve.settings import NewtonSettings

_SMALLEST = 1e-8
"""Singular values of the updates' products, over the largest, below which they are rounding."""
_FEW = 3  # factorisations of an easy step


class AndersonMixing:
    """Anderson's mixing of the updates since the tangent was factorised.

    Updates with factors of an earlier tangent shrink by the same factor again and again. The
    combination of the last ones that leaves the least update of all is about as good as a Krylov
    method on the tangent would be, and needs no tangent: D. G. Anderson, J. ACM 12 (1965) 547-560;
    H. F. Walker and P. Ni, SIAM J. Numer. Anal. 49 (2011) 1715-1735.

    Parameters
    ----------
    comm
        Ranks that the unknown is spread over.
    depth
        Number of earlier updates that are remembered; 0 for none.
    """

    def __init__(self, comm: MPI.Comm, depth: int) -> None:
        self._comm, self._depth = comm, depth
        self._last: tuple[FloatArray, FloatArray] | None = None
        self._count = 0
        # Changes of state and update from one iteration to the next, and the products of the latter.
        self._moves, self._gains = np.zeros((depth, 0)), np.zeros((depth, 0))
        self._products = np.zeros((depth, depth))

    def forget(self) -> None:
        """Begin anew: the factors are others."""
        self._last, self._count = None, 0

    def improved(self, state: FloatArray, update: FloatArray) -> FloatArray | None:
        """Return a better update, to be added to a state, or None at the first with these factors.

        Parameters
        ----------
        state, update
            A rank's own part; (n,).
        """
        last, self._last = self._last, (state.copy(), update.copy())
        if last is None or self._depth == 0:
            return None
        if self._moves.shape[1] != len(state):
            self._moves, self._gains = (np.empty((self._depth, len(state))) for _ in range(2))
        place = self._count % self._depth
        self._count += 1
        known = min(self._count, self._depth)
        moves, gains = self._moves[:known], self._gains[:known]
        np.subtract(state, last[0], out=moves[place])
        np.subtract(update, last[1], out=gains[place])
        with_last, right = sum_over(self._comm, np.array([gains @ gains[place], gains @ update]))
        self._products[place, :known] = self._products[:known, place] = with_last
        products = self._products[:known, :known]
        size = np.sqrt(np.diag(products))
        if not np.all(size > 0):  # the same update once more says nothing
            self._count = 0
            return None
        share = np.linalg.lstsq(products / np.outer(size, size), right / size, rcond=_SMALLEST)[0] / size
        return np.asarray(update - share @ moves - share @ gains)


@dataclass(frozen=True, eq=False)
class Damping:
    """A force on every displacement towards an earlier state; see `legfem.solve.newton`."""

    anchor: FloatArray
    """Unknown at the earlier state, ghosts included."""
    strength: float
    """Stiffness of the damping over the median of the tangent's diagonal."""


class Damper:
    """Adds a damping to a system's residual and tangent.

    Parameters
    ----------
    system
        The model.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._damping: Damping | None = None
        self._stiffness: FloatArray | None = None

    @property
    def acts(self) -> bool:
        """Whether the step is damped."""
        return self._damping is not None

    def turn_to(self, damping: Damping | None) -> None:
        """Set the damping of the following residuals and tangents; None removes it."""
        self._damping = damping
        if damping is not None and self._stiffness is None:
            self._stiffness = self._usual_stiffness()

    def stiffen(self, tangent: PETSc.Mat) -> None:
        """Add the damping's stiffness to an assembled tangent."""
        if self._damping is not None:
            added = self._system.unknown.x.petsc_vec.duplicate()
            added.array[:] = self._weights(self._damping)
            tangent.setDiagonal(added, addv=PETSc.InsertMode.ADD)

    def push(self, residual: FloatArray) -> None:
        """Add the damping's forces at the system's present unknown to a residual (n,)."""
        if self._damping is not None:
            weights = self._weights(self._damping)
            owned = slice(len(weights))
            away = self._system.unknown.x.array[owned] - self._damping.anchor[owned]
            residual[owned] += weights * away

    def _weights(self, damping: Damping) -> FloatArray:
        assert self._stiffness is not None
        return damping.strength * self._stiffness

    def _usual_stiffness(self) -> FloatArray:
        """Return the median of the tangent's diagonal, on the rank's own free displacements."""
        diagonal = np.abs(self._system.assemble_tangent().getDiagonal().array)
        free = np.zeros(len(diagonal), dtype=bool)
        displacements = self._system.spaces.displacement_dofs
        free[displacements[displacements < len(free)]] = True
        free[self._system.owned_supports] = False
        everywhere = np.concatenate(self._system.comm.allgather(diagonal[free]))
        return np.where(free, np.median(everywhere), 0.0)


class NewtonSolver:
    """Solves the system at a fixed position of the indenter.

    Parameters
    ----------
    system
        The model.
    settings
        Settings of Newton's method.
    linear
        Settings of the linear solver.
    """

    def __init__(
        self, system: System, settings: NewtonSettings | None = None, linear: LinearSettings | None = None
    ) -> None:
        linear = linear or LinearSettings()
        self._system = system
        self._settings = settings or NewtonSettings()
        self._norms: list[float] = []
        self._damper = Damper(system)
        self._factorisations, self._fresh, self._went_well = 0, False, False
        self._mixing = AndersonMixing(system.comm, self._settings.mixing)
        matrix = system.tangent_matrix
        vector = system.residual_vector.x.petsc_vec
        unknown = system.unknown.x.petsc_vec
        self._solution, self._trial = unknown.duplicate(), unknown.duplicate()
        self._evaluated = unknown.duplicate()
        self._evaluated_now = False
        self._least_ratio: float | None = None
        snes = PETSc.SNES().create(system.comm)
        snes.setOptionsPrefix("legfem_")
        snes.setType("newtonls")
        options = PETSc.Options("legfem_")
        options.setValue("snes_linesearch_type", "basic")
        snes.setFunction(self._function, vector.duplicate())
        snes.setJacobian(self._jacobian, matrix)
        snes.setLineSearchPreCheck(self._shorten)
        snes.setConvergenceTest(self._converged)
        snes.setTolerances(max_it=60, stol=0.0)
        self._iterates = linear.iterates(system.spaces)
        self._held = system.owned_supports
        self._saddle = None
        if self._iterates and system.spaces.formulation == "continuous":
            self._saddle = SaddlePreconditioner(system)
            self._saddle.configure(snes.getKSP(), linear)
        else:
            configure(snes.getKSP(), system.spaces, linear)
        prepare(matrix, system.spaces, linear)
        snes.setFromOptions()
        self._snes = snes

    @property
    def linear_solver(self) -> PETSc.KSP:
        """Linear solver with the factors of the last tangent."""
        return self._snes.getKSP()

    def solve(self, damping: Damping | None = None) -> NewtonOutcome:
        """Solve from the system's present unknown, which the solution replaces if found.

        Parameters
        ----------
        damping
            Damping of a step on the way to an equilibrium, for which a rough solution is enough.
        """
        self._norms, self._factorisations, self._evaluated_now = [], 0, False
        self._damper.turn_to(damping)
        self._system.unknown.x.petsc_vec.copy(self._solution)
        self._snes.solve(None, self._solution)
        reason = self._snes.getConvergedReason()
        converged = reason > 0
        if converged:
            self._load(self._solution)
            converged = self._volume_ratio(self._solution) > 0
        self._went_well = converged and self._settings.keeps_body and self._factorisations <= _FEW
        return NewtonOutcome(
            converged,
            _describe(reason) if converged or reason <= 0 else "an element is inverted",
            self._factorisations,
            self._snes.getIterationNumber(),
            self._norms[-1] if self._norms else np.inf,
        )

    def refactor(self, renew: bool = True) -> None:
        """Factorise the tangent at the present state.

        Without ``renew`` factors that are kept may do, as in solving.
        """
        self._assemble_tangent()
        if renew:
            renew_factors(self.linear_solver)
        self.linear_solver.setUp()

    def _assemble_tangent(self, reuse: bool = False) -> None:
        tangent = self._system.assemble_tangent(keep=self._settings.keeps_body, reuse=reuse)
        self._damper.stiffen(tangent)
        if self._saddle is not None:
            self._saddle.update()

    def _load(self, vector: PETSc.Vec) -> None:
        unknown = self._system.unknown
        vector.copy(unknown.x.petsc_vec)
        unknown.x.scatter_forward()

    def _function(self, snes: Any, state: PETSc.Vec, residual: PETSc.Vec) -> None:
        if not self._is_evaluated(state):
            self._load(state)
            self._evaluate()
        self._system.residual_vector.x.petsc_vec.copy(residual)

    def _evaluate(self) -> None:
        """Assemble the residual at the system's present unknown, and remember where that was."""
        self._damper.push(self._system.assemble_residual().x.array)
        self._system.unknown.x.petsc_vec.copy(self._evaluated)
        self._evaluated_now, self._least_ratio = True, None

    def _volume_ratio(self, state: PETSc.Vec) -> float:
        """Return the least J at a state: as a rule `_shorten` has just found it."""
        if self._least_ratio is not None and self._is_evaluated(state):
            return self._least_ratio
        self._load(state)
        return self._system.minimum_volume_ratio()

    def _is_evaluated(self, state: PETSc.Vec) -> bool:
        """Tell whether the residual at hand is that of a state.

        SNES asks for the residual where `_shorten` has just evaluated it.
        """
        same = self._evaluated_now and np.array_equal(state.array_r, self._evaluated.array_r)
        return bool(self._system.comm.allreduce(same, MPI.LAND))

    def _jacobian(self, snes: Any, state: PETSc.Vec, matrix: Any, preconditioner: Any) -> None:
        norms = self._norms
        gained = len(norms) > 1 and norms[-1] < self._settings.reuse * norms[-2]
        # An iterative solver has no factors to use again.
        if gained and self._factorisations and not self._iterates:
            self._fresh = False
            return
        # Since an easy step the body has changed little, and the contact may have much.
        reuse = self._went_well and not self._factorisations and not self._damper.acts
        self._fresh = not reuse
        self._load(state)
        self._assemble_tangent(reuse)
        self._factorisations += 1
        self._mixing.forget()

    def _shorten(self, state: PETSc.Vec, update: PETSc.Vec) -> bool:
        """Halve an update until no element inverts and the residual is below one of late.

        Contact closes and opens within an iteration, so the residual may rise for once: a
        monotone search would creep along such kinks.
        """
        acceptable = max(self._norms[-self._settings.memory :])
        least = min(0.01, 0.2 * self._volume_ratio(state))
        changed = self._iterates
        if self._iterates:
            # An inexact solution moves the supports a little too, which no residual would show.
            with update as values:
                values[self._held] = 0.0
        else:
            mixed = self._mixing.improved(state.array_r, -update.array_r)
            if mixed is not None:
                update.array[:] = -mixed
                changed = True
        for halving in range(self._settings.max_halvings):
            self._trial.waxpy(-1.0, update, state)
            self._load(self._trial)
            ratio = self._system.minimum_volume_ratio()
            if ratio > least:
                self._evaluate()
                self._least_ratio = ratio
                if self._system.residual_norm() <= acceptable:
                    return halving > 0 or changed
            update.scale(0.5)
        return True

    def _converged(self, snes: Any, iteration: int, norms: tuple[float, float, float]) -> int:
        norm = norms[2]
        self._norms.append(norm)
        reasons = PETSc.SNES.ConvergedReason
        if not np.isfinite(norm):
            return RESIDUAL_NOT_FINITE
        scale = self._system.contact_scale()
        tolerance, most = self._settings.relative_tolerance, self._settings.max_factorisations
        if self._damper.acts:
            tolerance, most = max(tolerance, self._settings.damped_tolerance), self._settings.damped_factorisations
        limit = self._settings.absolute_tolerance + tolerance * scale
        if norm <= limit and iteration > 0:
            return int(reasons.CONVERGED_FNORM_ABS)
        stalls = iteration > 0 and norm > 0.5 * self._norms[-2]
        if stalls and self._fresh and norm <= self._settings.floor * limit:
            return int(reasons.CONVERGED_FNORM_RELATIVE)
        if self._factorisations >= most and not (norm < self._settings.reuse * self._norms[-2]):
            return int(reasons.DIVERGED_MAX_IT)
        return 0


def _describe(reason: int) -> str:
    reasons = PETSc.SNES.ConvergedReason
    words = {
        reasons.CONVERGED_FNORM_ABS: "the residual is small",
        reasons.CONVERGED_FNORM_RELATIVE: "the residual is as small as rounding allows",
        RESIDUAL_NOT_FINITE: "the residual is not a number",
        reasons.DIVERGED_MAX_IT: "the residual stays large",
        reasons.DIVERGED_LINEAR_SOLVE: "the tangent cannot be factorised",
        reasons.DIVERGED_FUNCTION_DOMAIN: "an element is inverted",
    }
    return words.get(reason, f"SNES reason {reason}")


RELAXED = "relaxed to another equilibrium"


@dataclass(frozen=True)
class RelaxationSettings:
    """How the damping falls; in multiples of the tangent's usual diagonal.

    Parameters
    ----------
    first, greatest : float
        Strength at the start, and above which it is given up: the body folds faster than that slows it.
    eased, raised : float
        Factors on the strength: after a damped step, beside the residual's, and where one failed.
    least, most_change, weakest : float
        Bounds of the factor after a damped step, and of the strength: weaker steps end at a saddle.
    near, nearer : float
        Residual over the contact's forces below which none is tried, and the factor on it after which again.
    most : int
        Factorisations at which it is given up, less than a curve's worth.
    """

    first: float = 1e-3
    greatest: float = 4.0
    eased: float = 0.7
    raised: float = 4.0
    least: float = 0.25
    most_change: float = 2.0
    weakest: float = 3e-4
    near: float = 1e-2
    nearer: float = 0.1
    most: int = 40


def relax(system: System, solver: NewtonSolver, settings: RelaxationSettings | None = None) -> NewtonOutcome:
    r"""Creep from the system's present unknown to an equilibrium, which replaces it if found.

    Where a path of equilibria ends the body creeps to another one: thin muscle between a stiff fascia and a bone
    buckles and folds. At a step's end the indenter then rests, and backward Euler steps of a fictitious time follow

    .. math:: \tau\, w\, \dot u = -R(u)

    with a damping that follows the residual until Newton's method converges without any: switched
    evolution relaxation (C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35 (1998) 508-523). A
    descent passes maxima and saddles of the energy, so that what it ends at is an equilibrium that
    a slow experiment would snap to; only that state, undamped, is a result.

    Returns
    -------
    NewtonOutcome
        Outcome of the last solution, with the factorisations and iterations of all.
    """
    given = settings or RelaxationSettings()
    unknown = system.unknown.x.array
    factorisations = iterations = 0
    strength, failed, norm = given.first, math.inf, _norm(system)
    outcome = NewtonOutcome(False, "no damping was enough", 0, 0, math.inf)
    while factorisations < given.most and strength <= given.greatest:
        anchor = unknown.copy()
        damped = norm > min(given.near * system.contact_scale(), given.nearer * failed)
        system.seek()
        outcome = solver.solve(Damping(anchor, strength) if damped else None)
        factorisations += outcome.factorisations
        iterations += outcome.iterations
        if outcome.converged and not damped:
            outcome = replace(outcome, reason=RELAXED)
            break
        if outcome.converged:
            before, norm = norm, _norm(system)
            strength *= min(max(given.eased * norm / before, given.least), given.most_change)
            strength = max(strength, given.weakest)
            continue
        unknown[:] = anchor
        if damped:
            strength *= given.raised
        else:
            failed = norm
    else:
        outcome = replace(outcome, converged=False, reason="creeps on")
    return replace(outcome, factorisations=factorisations, iterations=iterations)


def _norm(system: System) -> float:
    """Return the norm of the residual at a system's present unknown, without damping."""
    system.assemble_residual()
    return system.residual_norm()
