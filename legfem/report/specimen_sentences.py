"""What a page of specimens says in sentences: whose data they are, what was done, and how each law fared."""

from collections.abc import Sequence

from legfem.common.numbers import fit_probability
from legfem.inverse.catalogue import is_ratio
from legfem.inverse.fit import Fit
from legfem.report.further_channels import channel_lines
from legfem.report.style import LAW_NAMES
from legfem.specimens.comparison import SHAPE_SD_OF_LAYERS
from legfem.specimens.details import SpecimenDetails, compared, rms_percent

type SpecimenFit = Fit[SpecimenDetails]


def procedure(result: SpecimenFit) -> str:
    """Return what was done with the recordings, as a paragraph."""
    every = result.details.folder.recordings
    note, axes = " ".join(dict.fromkeys(filter(None, (one.sizes.kind.note for one in every)))), every[0].axes
    timed = [one.recording.timed for one in every]
    fitted, together = sum(one.fitted for one in result.tests), "1 recording was fitted"
    if fitted > 1:
        together = f"{fitted} recordings were fitted together by one law, weighted equally relative to their greatest "
        together += f"{axes.load},"
    said = "to the first return; recordings after that were not used. "
    if result.details.folder.returns:
        said = "until hardly any force was left, with the returns as they were driven. "
    if not all(timed):
        said += f"{'Some' if any(timed) else 'They'} are tables of stretch and stress without a time, so nothing is "
        said += "known of rates; forces are those on a body of the stated size, or on a cube of 10 mm. The errors of "
        said += "the tables are their differences from a smooth curve. "
    if result.details.folder.relaxes:
        said += "Its stress relaxes with one log-normal spectrum of times: faster at larger strain if recordings at "
        said += "two rates show that, otherwise quasi-linearly. This is exact where the whole specimen has the same "
        said += "strain, and an approximation for small strain elsewhere. "
    if result.details.stiffness:
        said += "Each specimen has its own stiffness, a factor on the law's; the law describes a typical specimen (the "
        said += "geometric mean), and its interval includes the differences between specimens. "
    return (
        f"{together} from first contact {said}{_of_layers(result)}{_of_fibres(result)}{f'{note} ' if note else ''}"
        "A genetic algorithm (pygad) searched on an emulator of the tests, which full solves "
        "refined and confirmed. The intervals include the errors of the instrument and of the model, and the "
        f"factor by which recordings differ ({100 * result.details.gain_sd:.2g} %)."
    )


def _of_layers(result: SpecimenFit) -> str:
    tissues = result.details.folder.tissues
    if len(tissues) == 1:
        return ""
    stated = [one.name for one in tissues if "C10" in one.stated]
    held = f"the stiffness of {', '.join(stated)} is as stated, and " if stated else ""
    if result.details.folder.relaxes:
        after = " (so a stated stiffness is that after all relaxation)" if stated else ""
        held = f"they are taken to relax alike{after}; {held}"
    return (
        f"The layers are bonded to each other; {held}the shape of a curve is taken to be known to "
        f"{100 * SHAPE_SD_OF_LAYERS:.0f} %, because effects that the law leaves out bend it in the same way as "
        "layers of different stiffness. "
    )


def _of_fibres(result: SpecimenFit) -> str:
    (ratio,) = [name for name in result.values if is_ratio(name)] or [""]
    if not ratio:
        return ""
    sought = ratio in result.estimates
    shape, typical = f"the shape of a curve is taken to be known to {100 * SHAPE_SD_OF_LAYERS:.0f} %", ""
    if result.details.ratio_undetermined:
        shape = "the bend of a curve was not used, because fibres that are slack at first can change it by tens of "
        shape += "percent"
    elif sought and result.details.stiffness:
        typical = "Typical specimens of both directions are taken to be equally stiff, and a specimen that was turned "
        typical += "to be the same. "
    return (
        "The tissue is stiffer along its fibres: the ratio of its shear moduli is "
        f"{'estimated' if sought else f'taken to be {result.values[ratio]:.3g}'}, Young's modulus "
        f"along them being four times the modulus along less the modulus across; {shape}. {typical}"
    )


def followed(result: SpecimenFit) -> str:
    """Return how stiffness follows the size of what presses or is pressed, as a clause."""
    tables = "a stress of twice the true value, by its unit or measure, doubles the stiffness"
    every = result.details.folder.recordings
    return "; ".join(dict.fromkeys(one.sizes.kind.followed if one.recording.timed else tables for one in every))


def tested(results: Sequence[SpecimenFit]) -> list[str]:
    """Return how each law fared, how specimens differ, and how well what was left out is predicted."""
    lines = []
    for result in results:
        details, goodness = result.details, result.goodness
        lines.append(
            f"The {LAW_NAMES[result.law]} law differs from the recordings by {rms_percent(result):.2g} % (rms), "
            f"chi-square {goodness.chi_square:.4g} on {goodness.degrees_of_freedom} degrees of freedom "
            f"({fit_probability(goodness.p_value)})."
        )
        lines += channel_lines(result)
        if details.agreement is not None and not details.agreement.disagree:
            lines.append(details.agreement.text)
        if each := details.stiffness.values():
            lines.append(
                f"of a typical specimen: {len(each)} specimens are {min(each):.2f} to {max(each):.2f} times as stiff "
                f"(standard deviation of the logarithm {details.stiffness_spread:.2f})."
            )
        for one in (one for one in compared(result) if not one.fitted):
            load, stiff = one.recording.axes.load_text, ""
            if one.recording.specimen in details.stiffness:
                stiff = ", with the stiffness of its specimen in the other recordings"
            elif details.stiffness:
                stiff = f"; with {one.scale:.2f} times the stiffness of a typical specimen, {one.shape_r_squared:.3f}"
            lines.append(
                f"left out, {one.name}: predicted with R² {one.force.r_squared:.3f}, rmse {load(one.force.rms)} "
                f"({100 * one.force.rms / one.course.peak:.2g} % of {load(one.course.peak)}){stiff}."
            )
    return lines
