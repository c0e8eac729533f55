"""The report of a solution: how far it came, why it stopped, and the work of every step."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """One attempted step."""

    displacement: float
    """Displacement at its end, mm."""
    time: float
    """Time at its end, s."""
    size: float
    """Size, mm; in a hold, s."""
    accepted: bool
    reason: str
    factorisations: int
    iterations: int
    residual: float
    """Norm of the residual, N/mm in 2D, N in 3D."""


@dataclass(frozen=True)
class SolveReport:
    """How far a solution came, why it stopped, and the work it took."""

    reached: float
    """Greatest displacement (mm)."""
    target: float
    """Greatest displacement asked for (mm)."""
    complete: bool
    """Whether the whole path was followed."""
    reason: str
    """Why it stopped."""
    steps: tuple[Step, ...] = ()
    seconds: float = 0.0
    unknowns: int = 0
    contact_stiffness_factor: float = 1.0
    """Factor on the contact's stiffness; below 1 where it had to be softened to go on."""
    more_points: bool = False
    """Whether more points of integration went on where the usual ones had stopped."""
    without_pressures: bool = False
    """Whether a form of displacements alone went on where that with pressures had stopped."""
    earlier_attempts: tuple[SolveReport, ...] = ()

    @property
    def factorisations(self) -> int:
        """Factorisations of all steps, accepted or not, and of all attempts."""
        own = sum(step.factorisations for step in self.steps)
        return own + sum(report.factorisations for report in self.earlier_attempts)

    @property
    def iterations(self) -> int:
        """Newton iterations of all steps of this attempt."""
        return sum(step.iterations for step in self.steps)

    @property
    def rejected(self) -> int:
        """Number of rejected steps."""
        return sum(not step.accepted for step in self.steps)

    @property
    def compromise(self) -> str:
        """Compromises that were made to go on, in words; empty without any."""
        given_up = []
        if self.contact_stiffness_factor < 1:
            given_up.append(f"a contact {1 / self.contact_stiffness_factor:.2g} times softer")
        if self.more_points:
            given_up.append("more points of integration than elsewhere")
        if self.without_pressures:
            given_up.append("a form without pressures of its own")
        return " and ".join(given_up)

    def __str__(self) -> str:
        """Return one line for a log."""
        end = "complete" if self.complete else f"stopped: {self.reason}"
        return (
            f"{self.reached:.2f} of {self.target:.2f} mm ({end}); {len(self.steps)} steps, "
            f"{self.rejected} rejected, {self.factorisations} factorisations, {self.seconds:.1f} s"
        )
