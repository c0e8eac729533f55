"""A section solved once more for the report, its states kept for a reader to press."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from legfem.experiments.experiment import Solved
from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.fem.fields import FieldReader, LegFields
from legfem.mechanics.integration_domain import Skin
from legfem.report.web.section import Film, PressedSection, pressed_section


@dataclass(frozen=True, eq=False)
class Filmed:
    """A solution, and the states on its way; none of those where ranks share a section."""

    experiment: PlaneStrainIndentation
    film: Film | None
    solved: Solved

    @property
    def is_final(self) -> bool:
        """Whether the system is in the solution's last state: a finer mesh has another."""
        mesh, system = self.experiment.section_mesh, self.experiment.system
        skin = system.skin.domain
        assert isinstance(skin, Skin)
        here = float((skin.centre.value - mesh.touch) @ mesh.direction)
        own_mesh = self.solved.report.unknowns == system.spaces.unknowns
        return own_mesh and bool(np.isclose(here, self.solved.report.reached))

    @property
    def fields(self) -> LegFields:
        """Of the system's present state, by the film's expressions where it has some."""
        film = self.film
        reader = FieldReader(self.experiment.system) if film is None else film.reader
        return reader.read()

    def section(self, what: str) -> PressedSection | None:
        """Return the section to press, of ``what`` in words; None where there is none to show."""
        if self.film is None or not self.is_final:
            return None
        return pressed_section(
            self.film,
            self.solved.curve.displacement,
            self.solved.curve.force,
            f"Section of the leg with {what} while the cylinder is pressed in (model): its mesh, "
            "coloured by the hydrostatic pressure, by how far the tissue moved, by its greatest "
            "stretch (1 is none) or by tissue. Dashed: the skin before. The force is that of plane "
            "strain times the cylinder's length, without a correction for its ends.",
        )


def filmed(experiment: PlaneStrainIndentation, values: Mapping[str, float], depth: float) -> Filmed:
    """Solve for values (MPa, 1/MPa) to a depth (mm), unless that was done in this process."""
    film = Film(experiment, depth) if experiment.comm.size == 1 else None
    replay = experiment.replays.find(values, depth)
    if film is not None and replay is not None and replay.solved is not None:
        for at in replay.show():
            film.take(at)
        return Filmed(experiment, film, replay.solved)
    on_step = None if film is None else film.take
    return Filmed(experiment, film, experiment.solve(values, depth, on_step=on_step))
