"""A law and the first contact of every recording, found together."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from legfem.common.errors import InputError
from legfem.inverse.search import Search
from legfem.inverse.searches import run_together
from legfem.specimens.comparing import misfit_of
from legfem.specimens.contacts import SETTLED
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.misfit import SpecimenMisfit
from legfem.specimens.recorded import SpecimenRecording

_MOST_ROUNDS = 6


def with_contacts(
    search: Search[SpecimenMisfit],
    fitted: Sequence[SpecimenRecording],
    model: SpecimenForward,
    folder: SpecimenFolder,
    seeks: bool,
) -> tuple[Search[SpecimenMisfit], list[SpecimenRecording]]:
    """Run a search, move contacts to where it has them, and search again until they stay.

    Parameters
    ----------
    search
        Of a law, beside recordings from where contacts were detected.
    fitted
        Those recordings.
    model
        Of their tests.
    folder
        Theirs.
    seeks
        Whether the fibres' ratio is free.

    Returns
    -------
    search, recordings
        The last, and what it is beside.
    """
    fitted = list(fitted)
    run_together([search])
    for _ in range(_MOST_ROUNDS):
        moved = _begun(fitted, search, folder.returns)
        if moved is None:
            break
        fitted = moved
        search = search.beside(_misfit_beside(fitted, search, model, folder, seeks))
        run_together([search])
    return search, fitted


def where_it_seems(one: SpecimenRecording, returns: bool) -> SpecimenRecording:
    """Return a recording from where contact seems to be: nothing of it then is air."""
    found = one.detected
    if not found.known and found.estimate > found.displacement:
        with suppress(InputError):
            return one.begun(found.estimate, returns)
    return one


def _begun(
    fitted: list[SpecimenRecording], search: Search[SpecimenMisfit], returns: bool
) -> list[SpecimenRecording] | None:
    """Return recordings from where a fit has their contacts; None where all stay."""
    assert search.best.prediction is not None
    moved, misfit = list(fitted), search.misfit
    for k, ahead in enumerate(misfit.aheads(search.best.prediction.force)):
        one = fitted[k]
        now, (expected, sd) = one.course.contact.displacement, one.detected.expected
        # What is solved goes so deep.
        place = max(expected + ahead, now + one.course.depth - misfit.depths[misfit.parts[k].test])
        if abs(place - now) > SETTLED * sd:
            with suppress(InputError):
                moved[k] = one.begun(place, returns)
    return None if moved == fitted else moved


def _misfit_beside(
    fitted: Sequence[SpecimenRecording],
    search: Search[SpecimenMisfit],
    model: SpecimenForward,
    folder: SpecimenFolder,
    seeks: bool,
) -> SpecimenMisfit:
    """Return the misfit of recordings with the slopes of a search's forces."""
    assert search.best.prediction is not None
    by_itself = misfit_of(fitted, model, folder, seeks)
    readings = search.law.readings(search.best.point)
    slopes = by_itself.slopes(search.best.prediction.model_force, readings)
    return misfit_of(fitted, model, folder, seeks, slopes=slopes)
