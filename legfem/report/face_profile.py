"""How a specimen's face is strained across along its height, seen and of the models: the barrel of a pressed one."""

from collections.abc import Sequence

from legfem.inverse.fit import Fit
from legfem.report.curves import Curves, Line
from legfem.report.style import DATA_COLOUR, LAW_COLOURS, LAW_NAMES
from legfem.specimens.details import SpecimenDetails


def face_profile(fits: Sequence[Fit[SpecimenDetails]]) -> list[Curves]:
    """Return the panels of the profile; none where the face wasn't seen."""
    faces = [(fit.law, fit.details.face) for fit in fits if fit.details.face is not None]
    if not faces:
        return []
    heights, seen, _ = faces[0][1].profile
    lines = [Line("recorded", seen, None, DATA_COLOUR, points=True)]
    for law, face in faces:
        model = face.profile[2]
        lines.append(Line(f"model, {LAW_NAMES[law]}", model, model - face.profile[1], LAW_COLOURS[law]))
    caption = (
        "Strain across of the specimen's face at the deepest readings, from its middle (0) towards its end (1), the "
        "mean over recordings; beneath, the model less the recording. Ends that stick make a barrel of it."
    )
    label = "height from the middle, over half the specimen's"
    return [Curves("face-profile", caption, heights, label, "strain across (-)", "model − recorded (-)", lines)]
