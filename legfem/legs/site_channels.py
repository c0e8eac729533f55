"""Channels beside the force at a site: their readings along the loading, and what these err by."""

import numpy as np

from legfem.data import LoadingCurve
from legfem.geometry.section import layer_thicknesses
from legfem.inverse.loading_channels import LoadingChannel, loading_channel, loading_readings
from legfem.legs.nuisances import accuracy_of_shape
from legfem.legs.subject import Subject


def site_channels(subject: Subject, curve: LoadingCurve, model: str = "2d") -> tuple[LoadingChannel, ...]:
    """Return the channels of a site's trials that a model gives, in the loading as far as its mean curve goes.

    Parameters
    ----------
    subject
        With its trials.
    curve
        Their mean loading curve.
    model
        ``2d`` or ``3d``.
    """
    own = layer_thicknesses(subject.section, subject.indenter.aim, subject.indenter.direction)
    # Between two outlines.
    thickness_sd, noise = np.sqrt(2) * accuracy_of_shape(subject).contour_sd, curve.noise
    found = []
    for one in loading_readings(subject.trials, float(curve.displacement[-1]), model):
        force = np.interp(one.displacement, curve.displacement, curve.force, left=0.0)
        # Where contact is put, in each trial by itself and in all.
        contact = noise.shift_sd**2 * np.equal.outer(one.trial, one.trial) + noise.common_shift_sd**2
        at_rest = own.get(one.name, 0.0)
        found.append(loading_channel(one, subject.trials, force, contact, at_rest, thickness_sd))
    return tuple(found)
