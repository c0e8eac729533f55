"""Stiffness identified from recordings of a leg, its sites or specimens."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from mpi4py import MPI

from legfem.api import loading
from legfem.api.results import Identification
from legfem.common.errors import MISSING, Argument, InputError
from legfem.common.progress import progress_on
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.geometry.section import MUSCLE
from legfem.inverse.catalogue import DEEP_C10, LawName, check_held
from legfem.inverse.parameter import Parameter
from legfem.inverse.parse_parameters import AskedParameters
from legfem.inverse.readings import INSTRUMENT
from legfem.inverse.settings import AskedWeighting, IdentificationSettings, SearchRequest
from legfem.legs.identification import as_leg, check_joint, identify_leg, nominal_of, searches_in_3d
from legfem.legs.model_3d import check_has_ends
from legfem.legs.problem import section_forward
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import SitedLeg, Subject
from legfem.meshing.section import SectionMeshSettings

if TYPE_CHECKING:
    from legfem.specimens.folder import SpecimenFolder

type Names = Annotated[
    Sequence[Parameter | str], loading.Wanted("give a list of full names or of legfem.inverse.parameter.Parameter")
]
type Held = Annotated[
    Mapping[str, float] | Sequence[str],
    loading.Wanted("give values by full name, as {'deep.D1': 28.0}, or a list of texts, as ['deep.D1=28 1/MPa']"),
]
type Correction = Annotated[str | Path, loading.Wanted("give own, none, auto or a file", "is not a correction")]
type Settings = Annotated[IdentificationSettings, loading.Wanted("give legfem.inverse.settings.IdentificationSettings")]
type Mesh = PlaneStrainSettings | SolidLegSettings | Literal["coarse"]

type LegLaw = Literal["neo-hookean", "reduced-polynomial", "both"]
type Law = Annotated[
    LawName | Literal["both"],
    loading.Wanted("give neo-hookean, reduced-polynomial or both; of specimens also yeoh, exponential", "unknown law"),
]

COARSENING = 2.0
"""Factor on the elements' sizes, for a quick look."""


def asked_parameters(identify: Any, prior: Any, fix: Any, c10_bounds: Any, c20_bounds: Any) -> AskedParameters:
    """Return what arguments of `identify` ask for.

    Raises
    ------
    InputError
        If one is of another kind than `identify` says, or something is there twice.
    """
    if identify is not None and not identify:
        raise loading.wrong("identify", "[]", "nothing is left to identify", "name a parameter")
    names, given = list[str](), dict[str, Parameter]()
    for one in identify or ():
        name = one if isinstance(one, str) else one.name
        if name in names or name in given:
            raise loading.wrong("identify", name, "is there twice", "give it once")
        if not isinstance(one, str):
            given[name] = one
        if isinstance(one, str) or one.role == "identified":
            names.append(name)
    numbers, texts = (fix, ()) if isinstance(fix, Mapping) else ({}, fix)
    for name, value in numbers.items():
        # Without its term of (J - 1)^4 a law has an infinite D2.
        endless = value == math.inf and str(name).endswith(".D2")
        if not (math.isfinite(value) or endless):
            remedy = "give a number in MPa, 1/MPa, N or mm, without its unit"
            raise loading.wrong("fix", str(name), f"{value!r} is not a value", remedy)
        check_held(Argument("fix"), f"{name}={value:g}", str(name), float(value))
    return AskedParameters(names, prior, texts, c10_bounds, c20_bounds, given, numbers)


@loading.checked
def identify(
    leg: "Subject | SitedLeg | SpecimenFolder | loading.Given",
    law: Law | None = None,
    *,
    identify: Names | None = None,
    prior: loading.Texts = (),
    fix: Held = (),
    c10_bounds: loading.Pair | None = None,
    c20_bounds: loading.Pair | None = None,
    correction: Correction = "auto",
    depth: loading.Depth | None = None,
    model: Literal["2d", "3d"] = "2d",
    field: bool = False,
    site: str = "",
    leave_out: loading.Texts = (),
    weighting: AskedWeighting | None = None,
    seed: loading.Seed | None = None,
    settings: Settings | None = None,
    mesh: Mesh | None = None,
    out: loading.Folder | None = None,
    jobs: loading.Jobs = 1,
    progress: bool = False,
    comm: MPI.Intracomm | None = None,
) -> Identification:
    """Identify the stiffness of a leg's tissues, or of specimens, from recordings.

    All sites of a leg with several are fitted together. The leg itself is solved in 3D alone, without a section, where
    it has several sites, where its fibres' ratio is asked for, or where a turned cylinder, a ball or a punch pressed.

    Parameters
    ----------
    leg : Subject, SitedLeg, SpecimenFolder, str or Path
        What `load_subject`, `load_sites` or `load_specimen` returned; or a leg's id, or the folder of either.
    law : str, optional
        ``"neo-hookean"``, ``"reduced-polynomial"`` or ``"both"``; ``"yeoh"`` and ``"exponential"``
        of specimens. Without it both, of given parameters those that have them.
    identify : sequence of Parameter or str, optional
        What to identify, as full names (``"deep.C10"``, in 3D ``"deep.fibre_ratio"``), or with bounds, prior and role
        of your own; C10 and C20 of the deep tissue without them.
    prior : sequence of str
        What is known of parameters beforehand, as the command has it: ``"superficial.C10=2±1 kPa"``,
        ``"superficial.C10=2 x/ 1.5 kPa"`` for a factor, ``"superficial.C10=population"``.
    fix : Mapping[str, float] or sequence of str
        What is held in place of the folder's values: by full name in MPa, 1/MPa, N or mm; or as the command has it,
        ``"deep.D1=28 1/MPa"``.
    c10_bounds, c20_bounds : tuple of float, optional
        Ends of the search for the deep tissue's, kPa.
    correction : str or Path
        Correction for the cylinder's ends: ``"own"``, ``"none"``, a file, or ``"auto"``: the leg's own where
        it is due. There is none for what is solved in 3D alone.
    depth : float, optional
        Greatest displacement to use, mm.
    model : {"2d", "3d"}
        Whether the correction is a table's, or confirmed by full solves of the leg in 3D.
    field : bool
        Whether to map where the muscle is stiffer and where softer, see `legfem.legs.stiffness_field`; of one site in
        plane strain.
    site : str
        The one to identify by itself, of a leg with several ``[[site]]``.
    leave_out : sequence of str
        Recordings, specimens or tests of a folder of specimens that are predicted, and not fitted. Correction, depth,
        model, site and weighting are for legs alone.
    weighting, seed, settings
        Means of the search: the first two take the place of those in ``settings``, see
        `legfem.inverse.settings.IdentificationSettings`.
    mesh : PlaneStrainSettings, SolidLegSettings or "coarse", optional
        Finite elements of a section, or of a leg that is solved in 3D alone; ``"coarse"`` is
        for a quick look at a section, and no result to rely on.
    out : str or Path, optional
        Folder that keeps every full solve, so that the same call goes on where it was stopped;
        nothing is written without it.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.
    comm : MPI.Intracomm, optional
        Ranks over which solves in 3D are spread; this process alone without it.

    Returns
    -------
    Identification
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``, and a
        `legfem.inverse.fit.Fit` by law: ``found["neo-hookean"]``.

    Raises
    ------
    InputError
        If an argument is wrong, the leg can't be meshed or its recordings can't be used.
    SearchError
        If too few full solves reach the measured depth.

    Examples
    --------
    >>> import legfem as lf
    >>> found = lf.identify("3", law="both", prior=["superficial.C10=2±1 kPa"])  # or the path of a folder
    >>> print(found.summary())
    >>> found.to_frame()  # every parameter with its 95 % interval
    >>> found.write("results/identify-3")  # the report, as the command writes it
    """
    wanted = asked_parameters(identify, prior or (), fix, c10_bounds, c20_bounds)
    loading.check_folder("out", out)
    direct: dict[str, Any] = {"weighting": weighting, "seed": seed}
    stated = {name: value for name, value in direct.items() if value is not None}
    settings = replace(settings or IdentificationSettings(), **stated)
    loading.check_kind("seed", settings.seed, loading.Seed)
    loading.check_kind("weighting", settings.weighting, AskedWeighting | None)
    request = SearchRequest(depth=depth, settings=settings, out=None if out is None else Path(out), jobs=jobs)
    given = loading.opened(leg, site)
    with progress_on(quiet=not progress) as told:
        request = replace(request, as_field=field, progress=told)
        if loading.are_specimens(given):
            from legfem.specimens.laws import laws_named, request_of
            from legfem.specimens.problem import fit_specimens

            legs_alone = {
                "correction": str(correction) != "auto",
                "depth": depth is not None,
                "field": field,
                "mesh": mesh is not None,
                "model": model != "2d",
                "site": site != "",
                "weighting": weighting is not None,
            }
            loading.check_unused("specimens", legs_alone)
            asked = request_of(wanted, given.tissues)
            return Identification(given, tuple(fit_specimens(given, laws_named(law), asked, leave_out or (), request)))
        loading.check_unused("a leg", {"leave_out": bool(leave_out)})
        loading.check_kind("law", law, LegLaw | None)
        return _of_leg(given, law, wanted, request, str(correction), model == "3d", mesh, comm or MPI.COMM_SELF)


def _of_leg(
    given: Subject | SitedLeg,
    law: str | None,
    wanted: AskedParameters,
    request: SearchRequest,
    correction: str,
    in_3d: bool,
    mesh: Mesh | None,
    comm: MPI.Intracomm,
) -> Identification:
    leg = as_leg(given)
    for one in leg.sites:
        if not one.instrument.stated:
            remedy = "add force_sd_N and displacement_sd_mm, or accuracies"
            raise InputError(one.directory / SUBJECTS.file, "instrument", MISSING, remedy)
    if MUSCLE in leg.sites[0].section.lacks:
        wanted = wanted.renamed("pad", "deep")
    leg = replace(leg, sites=tuple(one.with_muscles(wanted.names) for one in leg.sites))
    solid = searches_in_3d(leg, wanted.names, in_3d)
    elsewhere = solid or in_3d or len(leg.sites) > 1 or leg.sites[0].muscles or leg.sites[0].section.lacks
    if request.as_field and (elsewhere or request.settings.weighting == "paper"):
        problem = "can be mapped only in the section of one site, for muscles that are identified as one"
        raise InputError(Argument("field"), DEEP_C10, problem, "leave 3D, other sites, muscles by name and paper out")
    if solid or len(leg.sites) > 1:
        check_joint(leg, request.settings, correction, in_3d)
    elif in_3d:
        check_has_ends(leg.sites[0])
    nominal = nominal_of(leg, solid)
    free, held = wanted.parameters(nominal, leg.sites[0].people), wanted.held(nominal)
    of_law = [one for one in free if one.name not in INSTRUMENT]
    laws = wanted.laws(law, of_law, leg.sites[0].tissues["deep"].C20, held)
    request = replace(request, parameters=free, fixed=held)
    plane, solid_numbers = _mesh_settings(mesh, solid)
    section = None if solid else section_forward(leg, request, plane)
    fits = identify_leg(leg, laws, request, correction, in_3d, comm, solid_numbers, section)
    return Identification(given, tuple(fits), section)


def _mesh_settings(mesh: Mesh | None, solid: bool) -> tuple[PlaneStrainSettings | None, SolidLegSettings | None]:
    """Return the finite elements of a section, and of a leg that is solved in 3D alone; None is the usual."""
    if solid and isinstance(mesh, SolidLegSettings | None):
        return None, mesh
    if not solid and isinstance(mesh, PlaneStrainSettings | None):
        return mesh, None
    if not solid and mesh == "coarse":
        return PlaneStrainSettings(SectionMeshSettings().refined(1 / COARSENING)), None
    problem = "is a section's" if solid else "is not a section's mesh"
    remedy = "leave it out, or give SolidLegSettings" if solid else "give coarse, or PlaneStrainSettings"
    raise loading.wrong("mesh", mesh if isinstance(mesh, str) else type(mesh).__name__, problem, remedy)
