"""A result as a DICOM structured report, template TID 1500, for a patient's study in a hospital's archive.

DICOM PS3.16 has no codes for constants of a strain energy: those of scheme ``99LEGFEM`` are legfem's own, units are
UCUM's. A 95 % interval is two further measurements of the same name, whose derivation says which limit each is; a
constant of which only a range is known, or that stands at a bound of its search, has them alone.
"""

import math
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import highdicom as hd
import pydicom
from highdicom import sr
from pydicom.errors import InvalidDicomError
from pydicom.sr.codedict import codes
from pydicom.uid import generate_uid

from legfem.common.errors import InputError
from legfem.inverse.answer import Value
from legfem.inverse.catalogue import key_of, symbol_of
from legfem.inverse.stored import StoredResult

SCHEME = "99LEGFEM"
_PATIENT = ("PatientID", "PatientName", "PatientBirthDate", "PatientSex")
_STUDY = ("AccessionNumber", "StudyID", "StudyDate", "StudyTime")
"""What a report has of its study, empty where the study's object has none."""


def _code(value: str, meaning: str) -> sr.CodedConcept:
    return sr.CodedConcept(value, SCHEME, meaning[:64])


LIMITS = tuple(_code(f"{end}-95", f"{end} limit of the 95 % interval") for end in ("lower", "upper"))


def _measured(name: str, known: Value) -> Iterator[sr.Measurement]:
    """Yield the measurements of one constant, by its full name."""
    called = _code(key_of(name), symbol_of(name))
    unit = sr.CodedConcept(known.unit.strip("-") or "1", "UCUM", known.unit or "1")
    if known.value is not None and not (known.range_only or known.at_bound):
        yield sr.Measurement(called, known.value, unit, derivation=codes.SCT.Calculated)
    for limit, value in zip(LIMITS, known.ci95 or (math.nan,) * 2, strict=True):
        if math.isfinite(value):
            yield sr.Measurement(called, value, unit, derivation=limit)


def structured_report(found: StoredResult, study: Path, visit: str = "") -> sr.EnhancedSR:
    """Return a result as a report in a patient's study; the same of the same result, study and visit.

    Parameters
    ----------
    found
        Of `legfem.inverse.stored.read_result`.
    study
        Any DICOM object of the study, as an image of the leg: patient and study are taken from it.
    visit
        What the visit is called; nothing without it.

    Raises
    ------
    InputError
        If the object is no DICOM, or names no study.
    """
    try:
        of = pydicom.dcmread(study, stop_before_pixels=True)
        told = [repr(found), visit, str(of.StudyInstanceUID), str(of.SOPInstanceUID)]
    except (OSError, AttributeError, InvalidDicomError):
        raise InputError(study, "file", "is no DICOM object of a study", "give an image of the study") from None
    for keyword in (*_PATIENT, *_STUDY):
        of.setdefault(keyword, "")
    version, law = found.versions.get("legfem", ""), str(found.answer.parameters.get("law", found.chosen))
    series, instance, tracked, device = (hd.UID(generate_uid(entropy_srcs=[*told, k])) for k in "abcd")
    finding = found.answer.finding.replace("_", " ") + ("; some input is doubted" if found.answer.doubts else "")
    group = sr.MeasurementsAndQualitativeEvaluations(
        sr.TrackingIdentifier(tracked, found.subject),
        algorithm_id=sr.AlgorithmIdentification("legfem", version, [f"law: {law}", f"kind: {found.kind}"]),
        time_point_context=sr.TimePointContext(visit) if visit else None,
        measurements=[one for name, known in found.answer.values.items() for one in _measured(name, known)],
        qualitative_evaluations=[
            sr.QualitativeEvaluation(_code(name, name), _code(value, text))
            for name, value, text in (("finding", found.answer.finding, finding), ("origin", *[found.origin] * 2))
        ],
    )
    observer = sr.ObserverContext(codes.DCM.Device, sr.DeviceObserverIdentifyingAttributes(device, "legfem"))
    procedure = _code("identification", "Mechanical properties of soft tissue, by indentation")
    context = sr.ObservationContext(observer_device_context=observer)
    reported = sr.MeasurementReport(context, procedure, [group], codes.DCM.ImagingMeasurementReport)
    made = {"manufacturer": "legfem", "is_complete": True, "series_description": "legfem"}
    return sr.EnhancedSR([of], reported, series, 1, instance, 1, software_versions=version, **made)


def files_of(report: sr.EnhancedSR) -> tuple[bytes, str]:
    """Return a report as DICOM's file and in its JSON model (PS3.18, annex F)."""
    file = BytesIO()
    report.save_as(file)
    return file.getvalue(), pydicom.dcmread(BytesIO(file.getvalue())).to_json()
