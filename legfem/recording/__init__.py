"""Recordings: reading, first contact, phases, and the mean loading curve."""

from legfem.recording.columns import Channel, Channels
from legfem.recording.contact import Contact, find_first_contact
from legfem.recording.curve import LoadingCurve, mean_loading_curve
from legfem.recording.instrument import Instrument, seen_instrument
from legfem.recording.noise import NoiseEstimate
from legfem.recording.phases import split_phases
from legfem.recording.reader import check_recording, read_instrument_file, read_recording
from legfem.recording.trial import Recording
from legfem.recording.writer import write_recording

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
