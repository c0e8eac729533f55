"""What is measured: instruments' files, recordings, phases, first contact, noise, the mean loading curve."""

from legfem.data.contact import Contact, Scales
from legfem.data.loading_curve import LoadingCurve, among_repeats, mean_loading_curve, segment_all
from legfem.data.noise import Instrument, seen_instrument
from legfem.data.quality import check_trial, quality_of
from legfem.data.reader import read_samples
from legfem.data.recording import Recording, SourceColumn, SourceColumns, write_recording
from legfem.data.segmentation import Segmentation, segment
