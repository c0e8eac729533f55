"""Recordings simulated from a true path: sampling in time, and instruments that err."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from legfem.common.units import FloatArray
from legfem.data.noise import Instrument
from legfem.data.recording import Recording


@dataclass(frozen=True)
class InstrumentNoise:
    """Errors of both channels: one part white, one that wanders along the path.

    Each channel's variance is the instrument's; a data sheet's accuracy covers wander (hysteresis,
    linearity) more than jitter.

    Parameters
    ----------
    instrument : Instrument
        Standard deviations of a reading.
    slow_share : float
        Share of the variance that wanders.
    correlation_mm : float
        Displacement over which the wander's correlation falls to 1/e.
    """

    instrument: Instrument
    slow_share: float = 0.5
    correlation_mm: float = 4.0


def record_path(
    displacement: FloatArray,
    force: FloatArray,
    rate: float,
    sampling: float,
    noise: InstrumentNoise,
    generator: np.random.Generator,
    trial: str,
) -> Recording:
    """Return the recording of a path walked at constant speed.

    Parameters
    ----------
    displacement, force
        The true path, (n,), mm and N, in the order in which it is walked.
    rate
        mm/s.
    sampling
        Hz.
    noise
        Of the instruments.
    generator
        Of the noise.
    trial
        Name.
    """
    walked = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(displacement)))])
    time = np.arange(0.0, walked[-1] / rate + 0.5 / sampling, 1 / sampling)
    at = np.minimum(time * rate, walked[-1])
    decay = np.exp(-rate / sampling / noise.correlation_mm)

    def error(sd: float) -> FloatArray:
        white = generator.normal(size=time.size) * np.sqrt(1 - noise.slow_share)
        drive = generator.normal(size=time.size) * np.sqrt(1 - decay**2)
        drive[0] = generator.normal()
        wander = lfilter([1.0], [1.0, -decay], drive) * np.sqrt(noise.slow_share)
        return sd * (white + wander)

    return Recording(
        time=time,
        displacement=np.interp(at, walked, displacement) + error(noise.instrument.displacement_sd),
        force=np.interp(at, walked, force) + error(noise.instrument.force_sd),
        trial=trial,
    )
