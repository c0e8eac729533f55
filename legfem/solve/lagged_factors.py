"""Factors of one tangent that serve its neighbours too.

Where many like systems are solved (states near each other, derivatives), factors of an earlier
tangent bring iterations on a later one to their end after a few. They are made anew once that takes
too many.
"""

from __future__ import annotations

from petsc4py import PETSc


class LaggedFactors:
    """A PETSc preconditioner that keeps a tangent's factors.

    Parameters
    ----------
    allowed : int
        Iterations of a solution above which the next tangent is factorised.
    """

    def __init__(self, allowed: int) -> None:
        self._allowed = allowed
        self._factors: PETSc.PC | None = None
        self._worn_out = True
        self.factorisations = 0

    def attach(self, linear: PETSc.KSP) -> None:
        """Become the preconditioner of a solver."""
        linear.getPC().setType("python")
        linear.getPC().setPythonContext(self)
        linear.setMonitor(self._watch)

    def renew(self) -> None:
        """Factorise the next tangent, however well these factors serve."""
        self._worn_out = True

    def setUp(self, preconditioner: PETSc.PC) -> None:
        """Factorise the tangent, if the factors at hand took too many iterations."""
        if not self._worn_out:
            return
        _, tangent = preconditioner.getOperators()
        if self._factors is None:
            self._factors = PETSc.PC().create(tangent.comm)
            self._factors.setType("lu")
            self._factors.setFactorSolverType("mumps")
        self._factors.setReusePreconditioner(False)
        self._factors.setOperators(tangent)
        self._factors.setUp()
        self._factors.setReusePreconditioner(True)
        self._worn_out = False
        self.factorisations += 1

    def apply(self, preconditioner: PETSc.PC, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the factors."""
        assert self._factors is not None
        self._factors.apply(right, solution)

    def _watch(self, linear: PETSc.KSP, iteration: int, norm: float) -> None:
        self._worn_out = self._worn_out or iteration > self._allowed
