"""What is measured: instruments' files, recordings, phases, first contact, noise, the mean loading curve."""

from legfem.data.columns import Channel, Channels
from legfem.data.contact import Contact, find_first_contact
from legfem.data.loading_curve import LoadingCurve, mean_loading_curve
from legfem.data.noise import Instrument, NoiseEstimate, seen_instrument
from legfem.data.reader import check_recording, read_instrument_file, read_recording
from legfem.data.recording import Recording, write_recording
from legfem.data.segmentation import split_phases

__all__ = [
    "Channel",
    "Channels",
    "Contact",
    "Instrument",
    "LoadingCurve",
    "NoiseEstimate",
    "Recording",
    "check_recording",
    "find_first_contact",
    "mean_loading_curve",
    "read_instrument_file",
    "read_recording",
    "seen_instrument",
    "split_phases",
    "write_recording",
]
