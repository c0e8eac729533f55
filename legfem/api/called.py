"""What a call of `legfem.identify` asks of a leg, before the leg's own values are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from legfem.inverse.laws import LawName
from legfem.legs.subject import Subject

if TYPE_CHECKING:
    from legfem.experiments.leg_3d import SolidLegSettings
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.inverse.catalogue import Values
    from legfem.inverse.parameter import Parameter
    from legfem.inverse.settings import SearchRequest

    type Mesh = PlaneStrainSettings | SolidLegSettings | Literal["coarse"]


@dataclass(frozen=True)
class IdentifyCall:
    """What is asked, as `legfem.identify` takes it.

    Parameters
    ----------
    law
        Of the deep tissue, or both.
    request
        Without parameters: those follow the leg's values.
    parameters
        Full names, or parameters.
    correction
        Name or file.
    in_3d
        Whether the leg itself is to be solved.
    mesh
        Of the finite elements.
    progress
        Whether to print what is being done.
    """

    law: str | None
    request: SearchRequest
    parameters: Sequence[Parameter | str] | None
    correction: str
    in_3d: bool
    mesh: Mesh | None
    progress: bool

    @property
    def names(self) -> set[str]:
        """Full names of all that is asked for or held."""
        free = self.parameters or ()
        return {*self.request.fixed, *(p if isinstance(p, str) else p.name for p in free)}

    def request_of(self, nominal: Values) -> SearchRequest:
        """Return the request, what is given by name with bounds that suit legs.

        Raises
        ------
        InputError
            For a name that the leg's values haven't.
        """
        from legfem.inverse.catalogue import check_known, parameter_of

        if self.parameters is None:
            return self.request
        check_known([one for one in self.parameters if isinstance(one, str)], nominal, "parameters")
        free = [parameter_of(p, nominal) if isinstance(p, str) else p for p in self.parameters]
        return replace(self.request, parameters=tuple(free))

    def laws(self, request: SearchRequest, nominal: Values, subject: Subject) -> list[LawName]:
        """Return the laws to identify, as the command chooses them."""
        from legfem.inverse.parse_parameters import Written
        from legfem.legs.laws import default_parameters

        given = request.parameters
        free = default_parameters(nominal) if given is None else given
        return Written().laws(self.law, free, subject.tissues["deep"].C20, request.fixed)
