r"""What each test says by itself, and whether the tests of a problem agree.

With the joint optimum :math:`\theta`, the residual :math:`r_k` of a test and its gain :math:`G_k`, a test by itself
asks to first order for :math:`\theta - G_k r_k`. The errors of these are known together, with what the tests share
(the correction's error and the priors), so that their differences are weighed by what differs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.comparison import JointComparison
from legfem.inverse.fit import EXACT, Goodness, OwnEstimate
from legfem.inverse.least_squares import polished, with_unit_errors
from legfem.inverse.parameter import Domain
from legfem.inverse.searches import Found
from legfem.inverse.trial import Linearised


@dataclass(frozen=True, eq=False)
class SingleTests:
    """The tests of a joint fit, one by one.

    Parameters
    ----------
    found : Found
        The joint fit: p parameters, n readings and k priors.
    covariance : (n, n) array
        Of the readings' differences.
    """

    found: Found[JointComparison]
    covariance: FloatArray

    @cached_property
    def _errors(self) -> FloatArray:
        """Errors of readings and priors, (n + k, n + k)."""
        return with_unit_errors(self.covariance, len(self.found.linear.law.priors))

    @property
    def _comparison(self) -> JointComparison:
        return self.found.search.misfit

    @cached_property
    def _alone(self) -> list[Linearised]:
        """Every test's differences and the priors about the joint optimum."""
        linear, joint = self.found.linear, self._comparison
        return [
            Linearised(linear.law, joint.alone(number), linear.prediction.part(span), linear.point)
            for number, span in enumerate(joint.spans)
        ]

    @cached_property
    def _gains(self) -> list[FloatArray]:
        """How each test's parameters follow readings and priors; (p, n + k) each."""
        n = len(self._comparison)
        gains: list[FloatArray] = []
        for one, span in zip(self._alone, self._comparison.spans, strict=True):
            own = one.gain
            gain = np.zeros((len(own), n + len(one.law.priors)))
            gain[:, span], gain[:, n:] = np.split(own, [len(one.misfit)], axis=1)
            gains.append(gain)
        return gains

    @property
    def agreement(self) -> Goodness:
        """Whether the tests ask for the same parameters, to first order."""
        if len(self._comparison.tests) < 2:
            return EXACT
        asked = [-np.linalg.pinv(one.jacobian) @ one.residual for one in self._alone]
        p = len(asked[0])
        differences = np.kron(np.diff(np.eye(len(asked)), axis=0), np.eye(p))
        gain = differences @ np.vstack(self._gains)
        spread = gain @ self._errors @ gain.T
        # Stiffnesses differ in size by orders.
        sd = np.sqrt(np.diag(spread))
        values = differences @ np.concatenate(asked) / sd
        statistic = float(values @ np.linalg.pinv(spread / np.outer(sd, sd), rcond=1e-9) @ values)
        return Goodness.of(statistic, len(values))

    def goodness(self) -> list[Goodness]:
        """How far each test is from all together, where these miss least in their errors."""
        left, _ = self.found.linear.nearest(self.covariance)
        return [
            Goodness.of(float(left[span] @ np.linalg.solve(self.covariance[span, span], left[span])), len(left[span]))
            for span in self._comparison.spans
        ]

    def by_itself(self) -> list[dict[str, OwnEstimate]]:
        """Parameters as each test alone has them, on the emulator of the joint fit's solves; nothing of one test."""
        joint, linear = self._comparison, self.found.linear
        if len(joint.tests) < 2:
            return [{}]
        law = linear.law
        emulated, domain = self.found.search.emulated(), Domain(law.parameters)
        joint_gain = linear.gain
        found = []
        for number, (span, gain) in enumerate(zip(joint.spans, self._gains, strict=True)):
            alone = joint.alone(number)

            def residual(genes: FloatArray, alone: JointComparison = alone, span: slice = span) -> FloatArray:
                points = domain.values(genes)
                values = emulated.values(points)[..., span]
                return np.concatenate([alone.residual(values), law.priors.residual(points)], axis=-1)

            at = domain.values(polished(residual, domain.genes(linear.point)))
            error = np.sqrt(np.diag(gain @ self._errors @ gain.T))
            apart = gain - joint_gain
            of_difference = np.maximum(np.sqrt(np.diag(apart @ self._errors @ apart.T)), 1e-9 * error)
            found.append(
                {
                    name: OwnEstimate(
                        float(at[k]), float(error[k]), float((at[k] - linear.point[k]) / of_difference[k])
                    )
                    for k, name in enumerate(law.names)
                }
            )
        return found
