"""Whether the ratio of the fibres' stiffness can be told from a folder's tests."""

from collections.abc import Collection, Sequence

from legfem.common.errors import InputError
from legfem.inverse.catalogue import is_ratio
from legfem.specimens.folder import FILE, SpecimenFolder
from legfem.specimens.kind import WORDS
from legfem.specimens.sizes import SpecimenRecording, level_of


def seeks_ratio(names: Collection[str]) -> bool:
    """Return whether the fibres' ratio is among free parameters' full names."""
    return any(is_ratio(name) for name in names)


def kinds_of(recordings: Sequence[SpecimenRecording]) -> dict[str, tuple[str, ...]]:
    """Return how the fibres of each specimen lay in its tests, by its name; "" without fibres."""
    names = dict.fromkeys(one.specimen for one in recordings)
    return {name: tuple(sorted({level_of(one.sizes) for one in recordings if one.specimen == name})) for name in names}


def _directions(recordings: Sequence[SpecimenRecording]) -> list[str]:
    return sorted({level_of(one.sizes) for one in recordings})


def were_turned(recordings: Sequence[SpecimenRecording]) -> bool:
    """Return whether one specimen was tested in several directions."""
    return any(len(kinds) > 1 for kinds in kinds_of(recordings).values())


def tells_ratio(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> bool:
    """Return whether forces along the fibres and across tell their ratio.

    Specimens that have a stiffness of their own do so if one was tested in several directions, or
    if one direction has several: their spread then is that by which typical ones of the directions
    may differ by chance.
    """
    directions = len(_directions(recordings))
    several = len(kinds_of(recordings)) > directions
    return directions > 1 and (folder.equally_stiff or were_turned(recordings) or several)


def check_strained(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> None:
    """Check that fibres whose ratio is looked for are stretched or sheared by a test.

    Raises
    ------
    InputError
        If none is.
    """
    if _directions(recordings) == [WORDS["cylinder"]]:
        raise InputError(
            folder.directory / FILE,
            "fibres.ratio",
            f"no fitted test strains fibres {WORDS['cylinder']}",
            "state it (it changes nothing here), or test another direction too",
        )


def why_ratio_undetermined(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> str:
    """Return why the ratio of the fibres' stiffness can't be told, as a sentence; "" if it can."""
    if tells_ratio(folder, recordings):
        return ""
    directions = _directions(recordings)
    if len(directions) == 1:
        return (
            f"The fibres' ratio cannot be distinguished from C10: all fitted tests have fibres "
            f"{directions[0]}, where more of one looks like more of the other. Test another "
            "direction too, or state [fibres] ratio."
        )
    return (
        "The fibres' ratio cannot be determined from how specimens differ: each direction has one "
        "specimen of a stiffness of its own. Give them one name if they are one piece, turned; say "
        "[tissue] one_stiffness = true if they are equally stiff; test several in a direction; or "
        "state [fibres] ratio."
    )
