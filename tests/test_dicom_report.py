"""A result in a patient's study: a DICOM structured report by TID 1500, as another reader finds it."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path

import pydicom
import pytest
from highdicom import sr
from making_results import result
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import CTImageStorage, EnhancedSRStorage, ExplicitVRLittleEndian, generate_uid
from typer.testing import CliRunner

import legfem as lf
from legfem.commands.data import app
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.inverse.answer import Value
from legfem.inverse.document import fit_document
from legfem.inverse.stored import StoredResult
from legfem.report.dicom_report import structured_report


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    write_document(folder / "result.json", fit_document([result("neo-hookean"), result("reduced-polynomial")]))
    return folder


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A frame of a study that says no more than it has to."""
    made = Dataset()
    made.file_meta = FileMetaDataset()
    made.file_meta.TransferSyntaxUID, made.file_meta.MediaStorageSOPClassUID = ExplicitVRLittleEndian, CTImageStorage
    made.SOPClassUID, made.SOPInstanceUID = CTImageStorage, generate_uid()
    made.StudyInstanceUID, made.SeriesInstanceUID = generate_uid(), generate_uid()
    made.PatientID, made.PatientName, made.PatientSex, made.StudyDate = "P-17", "Muster^Änne", "F", "20261130"
    made.SpecificCharacterSet = "ISO_IR 192"
    path = tmp_path_factory.mktemp("study") / "image.dcm"
    made.save_as(path, enforce_file_format=True)
    return path


def numbers(report: Path | sr.EnhancedSR) -> dict[tuple[str, str], tuple[float, str]]:
    """Return a report's numbers with their units by name and derivation."""
    if not isinstance(report, Path):
        file = BytesIO()
        report.save_as(file)
        file.seek(0)
    read = sr.srread(report if isinstance(report, Path) else file)
    (group,) = read.content.get_image_measurement_groups()
    every = group.get_measurements()
    return {(one.name.value, one.derivation.meaning): (one.value, one.unit.value) for one in every}


def test_a_report_has_the_constants_with_their_units_and_both_limits_in_the_patient_s_study(
    results: Path, image: Path
) -> None:
    words = ["dicom", str(results), "--of", str(image), "--visit", "before surgery", "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert pydicom.Dataset.from_json(done.stdout).Modality == "SR"
    path = results / "report.dcm"
    study, found = pydicom.dcmread(image), pydicom.dcmread(path)
    assert found.SOPClassUID == EnhancedSRStorage and found.Modality == "SR"
    for same in ("StudyInstanceUID", "PatientID", "PatientName", "PatientSex", "StudyDate"):
        assert found[same].value == study[same].value
    assert (found.VerificationFlag, found.PreliminaryFlag) == ("UNVERIFIED", "PRELIMINARY"), "a person signs it"
    assert found.ContentTemplateSequence[0].TemplateIdentifier == "1500"
    answer = lf.read_result(results).answer
    wanted = {}
    for key, name in (("c10_deep", "deep.C10"), ("c20_deep", "deep.C20")):
        known = answer.values[name]
        wanted[key, "Calculated"] = known.value, "kPa"
        for end, value in zip(("lower", "upper"), known.ci95, strict=True):
            wanted[key, f"{end} limit of the 95 % interval"] = value, "kPa"
    read = numbers(path)
    assert read.keys() == wanted.keys()
    for key, (value, unit) in wanted.items():
        assert read[key] == (pytest.approx(value, rel=1e-12), unit)
    text = path.read_bytes().decode(errors="replace")
    for said in ("before surgery", "UCUM", lf.read_result(results).subject, "law: reduced-polynomial"):
        assert said in text
    (group,) = sr.srread(path).content.get_image_measurement_groups()
    told = {one.name.value: one.value.value for one in group.get_qualitative_evaluations()}
    assert told == {"finding": str(answer.finding), "origin": lf.read_result(results).origin}


def test_a_range_and_what_stands_at_a_bound_have_no_value(results: Path, image: Path) -> None:
    found = lf.read_result(results)
    values = {
        "deep.C10": Value((0.5, 0.9), "kPa", 0.7, range_only=True),
        "deep.C20": Value((0.0, 3.0), "kPa", 3.0, at_bound="upper"),
        "deep.fibre_ratio": Value(None, "-", 1.5),
    }
    read = numbers(structured_report(replace(found, answer=replace(found.answer, values=values)), image))
    limits = {f"{end} limit of the 95 % interval" for end in ("lower", "upper")}
    assert {of for key, of in read if key == "c10_deep"} == limits
    assert {of for key, of in read if key == "c20_deep"} == limits
    assert read["fibre_ratio_deep", "Calculated"] == (1.5, "1")


def test_the_same_result_study_and_visit_make_the_same_object_and_another_visit_another(
    results: Path, image: Path
) -> None:
    found = lf.read_result(results)
    one, same, other = (structured_report(found, image, visit).SOPInstanceUID for visit in ("1", "1", "2"))
    assert one == same != other


def test_what_is_no_dicom_or_names_no_study_is_refused_in_a_line(results: Path, image: Path, tmp_path: Path) -> None:
    found = lf.read_result(results)
    (tmp_path / "photo.dcm").write_bytes(b"no")
    bare = pydicom.dcmread(image)
    del bare.StudyInstanceUID
    bare.save_as(tmp_path / "bare.dcm")
    each: list[tuple[StoredResult, Path, str]] = [
        (found, tmp_path / "photo.dcm", "no DICOM object"),
        (found, tmp_path / "none.dcm", "no DICOM object"),
        (found, tmp_path, "no DICOM object"),
        (found, tmp_path / "bare.dcm", "no DICOM object of a study"),
    ]
    for said, study, cause in each:
        with pytest.raises(InputError, match=cause):
            structured_report(said, study)
    done = CliRunner().invoke(app, ["dicom", str(tmp_path), "--of", str(image)])
    assert done.exit_code == 2 and not (tmp_path / "report.dcm").exists()
