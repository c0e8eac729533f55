r"""What each site of a leg says by itself, and whether the sites agree.

With the joint optimum :math:`\theta`, the residual :math:`r_k` of a site and its gain
:math:`G_k`, a site by itself asks to first order for :math:`\theta - G_k r_k`. The errors of
these are known together, with what the sites share (the correction's error and the priors), so that
their differences are weighed by what differs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from legfem.common.units import FloatArray
from legfem.inverse.least_squares import polished, with_unit_errors
from legfem.inverse.parameter import Domain
from legfem.inverse.searches import Found
from legfem.inverse.trial import Linearised
from legfem.sites.misfit import SitesMisfit
from legfem.sites.result import ByItself, Chance


@dataclass(frozen=True, eq=False)
class Apart:
    """The sites one by one.

    Parameters
    ----------
    found : Found
        The joint fit: p parameters, n forces and k priors.
    covariance : (n, n) array
        Of the forces' differences, N2.
    """

    found: Found[SitesMisfit]
    covariance: FloatArray

    @cached_property
    def _errors(self) -> FloatArray:
        """Of forces and priors; (n + k, n + k)."""
        return with_unit_errors(self.covariance, len(self.found.linear.law.priors))

    @cached_property
    def _sites(self) -> list[Linearised]:
        """Every site's misfit and the priors about the joint optimum."""
        linear = self.found.linear
        return [
            Linearised(linear.law, part, linear.prediction.of(span), linear.point)
            for part, span in zip(self._misfit.parts, self._misfit.spans, strict=True)
        ]

    @cached_property
    def _gains(self) -> list[FloatArray]:
        """How each site's parameters follow forces and priors; (p, n + k) each."""
        n = len(self._misfit)
        gains: list[FloatArray] = []
        for site, span in zip(self._sites, self._misfit.spans, strict=True):
            own = site.gain
            gain = np.zeros((len(own), n + len(site.law.priors)))
            gain[:, span], gain[:, n:] = np.split(own, [len(site.misfit)], axis=1)
            gains.append(gain)
        return gains

    @property
    def _misfit(self) -> SitesMisfit:
        return self.found.search.misfit

    @property
    def agreement(self) -> Chance:
        """Whether the sites ask for the same parameters, to first order."""
        if len(self._misfit.parts) < 2:
            return Chance(0.0, 0, 1.0)
        asked = [-np.linalg.pinv(site.jacobian) @ site.residual for site in self._sites]
        p = len(asked[0])
        differences = np.kron(np.diff(np.eye(len(asked)), axis=0), np.eye(p))
        gain = differences @ np.vstack(self._gains)
        spread = gain @ self._errors @ gain.T
        # Stiffnesses differ in size by orders.
        sd = np.sqrt(np.diag(spread))
        values = differences @ np.concatenate(asked) / sd
        statistic = float(values @ np.linalg.pinv(spread / np.outer(sd, sd), rcond=1e-9) @ values)
        return Chance(statistic, len(values), float(chi2.sf(statistic, len(values))))

    def misfits(self) -> list[Chance]:
        """Return how far each site is from the joint fit, in its errors."""
        linear = self.found.linear
        left = linear.prediction.force - linear.misfit.measured_force
        found = []
        for span in self._misfit.spans:
            own = float(left[span] @ np.linalg.solve(self.covariance[span, span], left[span]))
            n = len(left[span])
            found.append(Chance(own, n, float(chi2.sf(own, n))))
        return found

    def by_itself(self) -> list[dict[str, ByItself]]:
        """Return every site's own values, on the emulator of the joint fit's solves."""
        linear, search = self.found.linear, self.found.search
        law, misfit = linear.law, self._misfit
        emulated, domain = search.emulated(), Domain(law.parameters)
        joint = linear.gain
        sites = []
        for part, span, gain in zip(misfit.parts, misfit.spans, self._gains, strict=True):

            def residual(genes: FloatArray, part=part, span=span) -> FloatArray:  # type: ignore[no-untyped-def]
                points = domain.values(genes)
                force = emulated.force(points)[..., span]
                return np.concatenate([part.residual(force), law.priors.residual(points)], axis=-1)

            at = domain.values(polished(residual, domain.genes(linear.point)))
            error = np.sqrt(np.diag(gain @ self._errors @ gain.T))
            apart = gain - joint
            of_difference = np.sqrt(np.diag(apart @ self._errors @ apart.T))
            # Of a site alone there is no difference.
            of_difference = np.maximum(of_difference, 1e-9 * error)
            sites.append(
                {
                    name: ByItself(float(at[k]), float(error[k]), float((at[k] - linear.point[k]) / of_difference[k]))
                    for k, name in enumerate(law.names)
                }
            )
        return sites
