"""The study of public recordings: readers, and folders of specimens, where the data are there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from making import SHARED

from legfem.common.errors import InputError
from legfem.specimens.folder import load_specimen
from studies.recordings.data import phantom_kinds, read_meat, read_phantoms
from studies.recordings.folders import Assumed, write_specimen_folders

DATA = Path(os.environ.get("LEGFEM_DATA", SHARED / "data"))
needs_data = pytest.mark.skipif(not (DATA / "meat_indentation").is_dir(), reason="needs the recordings: LEGFEM_DATA")


def test_an_absent_folder_is_one_line(tmp_path):
    for read in (read_meat, phantom_kinds):
        with pytest.raises(InputError, match="studies/recordings"):
            read(tmp_path)


@needs_data
def test_the_data_are_read():
    meat = read_meat(DATA)
    assert len(meat) == 98
    assert sum(test.material.startswith("beef") for test in meat.values()) == 78
    phantom = read_phantoms(DATA, "EF10_75T")[0]
    assert (phantom.radius, phantom.height) == (25.0, 30.0)
    assert phantom.recording.displacement[-1] == pytest.approx(20.0, abs=0.01)


@needs_data
@pytest.mark.slow
def test_every_public_recording_stands_in_a_folder_of_specimens(tmp_path):
    folders = [load_specimen(f) for f in write_specimen_folders(DATA, tmp_path, Assumed())]
    assert sum(len(folder.recordings) for folder in folders) == 138
    assert not any(folder.left_out for folder in folders)
    beef = next(folder for folder in folders if folder.id == "beef_RDG")
    assert beef.relaxes and len({one.sizes for one in beef.recordings}) > 30
