"""Stiffness identified from recordings of a leg, or of specimens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from legfem.api.arguments import check_names, check_search, check_unused, in_python_words, wrong_mesh
from legfem.api.loading import Given, opened
from legfem.api.results import Identified
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.inverse.laws import LawName
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import SitedLeg, Subject

if TYPE_CHECKING:
    from legfem.inverse.parameter import Parameter
    from legfem.inverse.settings import IdentificationSettings
    from legfem.specimens.folder import SpecimenFolder

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


@overload
def identify(
    leg: SpecimenFolder,
    law: LawName | Literal["both"] | None = None,
    *,
    settings: IdentificationSettings | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter | str] | None = None,
    fixed: Mapping[str, float] | None = None,
    leave_out: Sequence[str] = (),
) -> Identified: ...
@overload
def identify(
    leg: Subject | SitedLeg | Given,
    law: LawName | Literal["both"] | None = None,
    *,
    correction: str = "auto",
    depth: float | None = None,
    settings: IdentificationSettings | None = None,
    mesh: Mesh | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter | str] | None = None,
    fixed: Mapping[str, float] | None = None,
    model: Literal["2d", "3d"] = "2d",
    site: str = "",
) -> Identified: ...
@in_python_words()
def identify(
    leg: Subject | SitedLeg | SpecimenFolder | Given,
    law: LawName | Literal["both"] | None = None,
    *,
    correction: str = "auto",
    depth: float | None = None,
    settings: IdentificationSettings | None = None,
    mesh: Mesh | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter | str] | None = None,
    fixed: Mapping[str, float] | None = None,
    leave_out: Sequence[str] = (),
    model: Literal["2d", "3d"] = "2d",
    site: str = "",
) -> Identified:
    """Identify the stiffness of a leg's tissues, or of specimens, from recordings.

    All sites of a leg with several are fitted together. So is one alone where the leg is solved in
    3D for its fibres' ratio, or is pressed by a turned cylinder, a ball or a punch.

    Parameters
    ----------
    leg : Subject, SitedLeg, SpecimenFolder, str or Path
        What `load_subject`, `load_sites` or `load_specimen` returned; or a leg's id or folder.
    law : str, optional
        ``"neo-hookean"``, ``"reduced-polynomial"`` or ``"both"``; ``"yeoh"`` and ``"exponential"``
        of specimens. Without it both, of given parameters those that have them.
    correction : str
        Of the cylinder's ends: ``"own"``, ``"none"``, a file, or ``"auto"``: the leg's own where
        it is due. Of sites that are solved in 3D there is none.
    depth : float, optional
        Greatest displacement to use, mm.
    settings : IdentificationSettings, optional
        Of the search: weighting, seed, minimiser.
    mesh : PlaneStrainSettings, SolidLegSettings or "coarse", optional
        Of a section's finite elements, or of those of sites that are solved in 3D; ``"coarse"`` is
        for a quick look at a section, and no result to rely on.
    out : str or Path, optional
        Folder that keeps every full solve, so that the same call goes on where it was stopped;
        nothing is written without it.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.
    parameters : sequence of Parameter or str, optional
        What to identify, as full names (``"deep.C10"``, in 3D ``"deep.fibre_ratio"``) or with
        bounds and priors; C10 and C20 of the deep tissue without them. See
        `legfem.inverse.settings.SearchRequest`.
    fixed : Mapping[str, float], optional
        Values that are held in place of the folder's, by full name, in MPa, 1/MPa, N or mm.
    leave_out : sequence of str
        Recordings or specimens of a folder of specimens that are predicted, and not fitted. Of
        specimens there are no correction, depth, mesh, model and site to choose.
    model : {"2d", "3d"}
        Whether the correction is a table's, or confirmed by full solves of the leg in 3D; sites
        together, and what doesn't lie along the leg, are solved in 3D alone.
    site : str
        Of a leg with several ``[[site]]`` the one to identify by itself.

    Returns
    -------
    Identified
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``.

    Raises
    ------
    InputError
        If the leg can't be meshed or its recordings can't be used.
    SearchError
        If too few full solves reach the measured depth.
    """
    from legfem.inverse.laws import LAWS
    from legfem.inverse.settings import IdentificationSettings, SearchRequest
    from legfem.legs.identification import as_leg
    from legfem.specimens.folder import SpecimenFolder

    check_search(parameters, fixed, depth, settings, out, jobs)
    if isinstance(leg, SpecimenFolder):
        check_unused(
            "specimens",
            {
                "correction": correction != "auto",
                "depth": depth is not None,
                "mesh": mesh is not None,
                "model": model != "2d",
                "site": site != "",
            },
        )
        check_names("leave_out", leave_out)
        means = SearchRequest(
            None, fixed or {}, None, settings or IdentificationSettings(), None if out is None else Path(out), jobs
        )
        return _identify_specimens(leg, law, leave_out, means, progress, parameters)
    if law not in (*LAWS, "both", None):
        raise InputError("law", repr(law), "unknown law", f"give one of {', '.join(LAWS)}, both")
    if model not in ("2d", "3d"):
        raise InputError("model", repr(model), "unknown model", "give 2d or 3d")
    if not isinstance(correction, str | Path):
        raise InputError("correction", repr(correction), "is no correction", "give own, none, auto or a file")
    check_unused("a leg", {"leave_out": bool(leave_out)})
    given, in_3d = opened(leg, site), model == "3d"
    assert not isinstance(given, SpecimenFolder)
    for one in given.sites if isinstance(given, SitedLeg) else (given,):
        if not one.instrument.stated:
            raise InputError(
                one.directory / SUBJECTS.file,
                "instrument",
                "missing",
                "add force_sd_N and displacement_sd_mm, or accuracies",
            )
    request = SearchRequest(
        None, fixed or {}, depth, settings or IdentificationSettings(), None if out is None else Path(out), jobs
    )
    asked = IdentifyCall(law, request, parameters, str(correction), in_3d, mesh, progress)
    return _identify_leg(as_leg(given), asked)


def _identify_leg(leg: SitedLeg, asked: IdentifyCall) -> Identified:
    """Identify what all sites of a leg share; see `identify`."""
    from legfem.legs.identification import check_joint, identify_leg, nominal_of, searches_in_3d
    from legfem.legs.model_3d import check_has_ends
    from legfem.legs.problem import section_forward

    in_3d = asked.in_3d
    only_in_3d = searches_in_3d(leg, asked.names, in_3d)
    nominal = nominal_of(leg, only_in_3d)
    if only_in_3d or len(leg.sites) > 1:
        check_joint(leg, asked.request.settings, asked.correction, only_in_3d)
    elif in_3d:
        check_has_ends(leg.sites[0])
    request = asked.request_of(nominal)
    laws = asked.laws(request, nominal, leg.sites[0])
    forward = None if only_in_3d else section_forward(leg, request, _plane_settings(asked.mesh))
    solid = _solid_settings(asked.mesh) if only_in_3d else None
    with progress_on(quiet=not asked.progress) as shown:
        request = replace(request, progress=shown)
        fits = identify_leg(leg, laws, request, asked.correction, in_3d, settings=solid, forward=forward)
    single = forward is not None and len(leg.sites) == 1
    return Identified(tuple(fits), forward.models[0].experiment if single and forward is not None else None)


def _identify_specimens(
    folder: SpecimenFolder,
    law: str | None,
    leave_out: Sequence[str],
    request: SearchRequest,
    progress: bool,
    parameters: Sequence[Parameter | str] | None,
) -> Identified:
    """Identify a tissue's law from a folder of specimens; see `identify`."""
    from legfem.specimens.laws import Asked, laws_named
    from legfem.specimens.problem import fit_specimens

    names = tuple(
        one if isinstance(one, str) else one.name
        for one in parameters or ()
        if isinstance(one, str) or one.role == "identified"
    )
    given = [one for one in parameters or () if not isinstance(one, str)]
    asked = Asked(
        names,
        {one.name: one.prior for one in given if one.prior is not None},
        {one.name: one.bounds for one in given},
        request.fixed,
    )
    with progress_on(quiet=not progress) as shown:
        fits = fit_specimens(folder, laws_named(law), asked, leave_out, replace(request, progress=shown))
    return Identified(tuple(fits))


COARSENING = 2.0
"""Of the elements, for a quick look."""


def _plane_settings(mesh: Mesh | None) -> PlaneStrainSettings | None:
    """Return the numerical settings of sections that a call's ``mesh`` names.

    Raises
    ------
    InputError
        If it is none of a section's.
    """
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.meshing.section import SectionMeshSettings

    if mesh == "coarse":
        return PlaneStrainSettings(SectionMeshSettings().refined(1 / COARSENING))
    if mesh is None or isinstance(mesh, PlaneStrainSettings):
        return mesh
    raise wrong_mesh(mesh, "is no section's", "give coarse, or PlaneStrainSettings")


def _solid_settings(mesh: Mesh | None) -> SolidLegSettings | None:
    from legfem.experiments.leg_3d import SolidLegSettings

    if mesh is None or isinstance(mesh, SolidLegSettings):
        return mesh
    raise wrong_mesh(mesh, "is a section's", "leave it out, or give SolidLegSettings")
