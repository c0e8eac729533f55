"""Notices about specimens in words; see `legfem.report.notices`."""

from collections.abc import Mapping

from legfem.report.notices import Words
from legfem.specimens.details import SpecimenNotice

SPECIMENS: Mapping[str, Words] = {
    SpecimenNotice.MISFIT: Words(
        "The law does not describe these recordings within their errors",
        ". Its intervals are widened by what a law of the wrong form may do to the numbers, judged by the size of the "
        "misfit.",
    ),
    SpecimenNotice.BEGUN_IN_AIR: Words(
        "{count} recordings seem to begin in air",
        " ({names}): first contact was looked for. If displacement counts from first touch, say so in specimen.toml: "
        "[recordings] starts_at_contact = true.",
    ),
    SpecimenNotice.GOES_WITH_THICKNESS: Words("The constant depends on the thickness", whole="{text}"),
    SpecimenNotice.ALTERNATIVES: Words("The folder does not state how the test was done", whole="{text}"),
    SpecimenNotice.TESTS_DISAGREE: Words("The tests disagree", whole="{text}"),
    SpecimenNotice.USED_IN_PART: Words(
        "{name} is used to {used:.3g} of its {depth:.3g} mm", ": its test stopped there ({reason})."
    ),
    SpecimenNotice.NOT_MODELLED: Words("{name} was to be predicted, and can't be modelled", "."),
    SpecimenNotice.NOT_PREDICTED: Words("What was left out can't be predicted", ": {reason}."),
    SpecimenNotice.RATIO_UNDETERMINED: Words("The fibres' ratio cannot be distinguished from C10", whole="{text}"),
    SpecimenNotice.SIDE_SEEN: Words("What a camera saw of the side", whole="{text}"),
}
