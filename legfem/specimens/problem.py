"""Specimens as a problem: what of their recordings can be modelled, beside a model of all their tests.

First contact is found along with the law.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy.special import stdtrit

from legfem.common.errors import Argument, InputError
from legfem.common.units import FloatArray
from legfem.inverse.answer import Notice, doubted
from legfem.inverse.catalogue import IdentifiedLaw, LawName, Values, is_ratio, model_values
from legfem.inverse.comparison import ErrorSource, total_of
from legfem.inverse.estimates import Optimum, estimates
from legfem.inverse.fit import ChannelFit, Fit, Goodness, Identity, least_akaike, versions
from legfem.inverse.intervals import bound_of, quantile
from legfem.inverse.outcome import JointForward
from legfem.inverse.problem import cost_of, fit, goodness_of, log_of, search_settings
from legfem.inverse.readings import READINGS
from legfem.inverse.search import Search
from legfem.inverse.searches import Found
from legfem.inverse.settings import SearchRequest, free_of_model
from legfem.specimens import details
from legfem.specimens.comparison import SpecimenComparison, comparison_of
from legfem.specimens.course import QUICKENING, shows_quickening
from legfem.specimens.diagnosis import Prepared, prepare
from legfem.specimens.folder import SpecimenFolder, doubts_of
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import REFERENCE_MPA, ParameterRequest, identified_law
from legfem.specimens.model_discrepancy import LawMisfit, TestsAgreement, agreement_of_tests, fitted_change, misfit_of
from legfem.specimens.nuisances import SETTLED, check_strained, why_ratio_undetermined
from legfem.specimens.side import face_fit, lateral_fit
from legfem.specimens.sizes import OF_LAYER, RESIZED, Sizes, SpecimenRecording
from legfem.specimens.thickness import OnARig, goes_with_thickness, widened

_TOLD = 1.2
"""Factor by which a rig may hide stiffness, from which on it is said."""


@dataclass(frozen=True, eq=False)
class SpecimenProblem:
    """A law beside all recordings of a folder; a `legfem.inverse.problem.Problem`.

    Parameters
    ----------
    folder : SpecimenFolder
        With recordings.
    law : IdentifiedLaw
        What is free and held.
    prepared : Prepared
        Recordings that can be modelled.
    held_out : frozenset of str
        Names of recordings that are predicted, and not fitted.
    """

    folder: SpecimenFolder
    law: IdentifiedLaw
    prepared: Prepared
    held_out: frozenset[str]

    weighs_shared_errors = False
    """Recordings count alike in the search, whatever they share."""

    @cached_property
    def forward(self) -> JointForward[SpecimenForward]:
        """Models of the fitted recordings' tests."""
        return self._model([one for one in self.prepared.recordings if one.name not in self.held_out])

    @property
    def unknowns(self) -> dict[LawName, IdentifiedLaw]:
        """The law."""
        return {self.law.name: self.law}

    @property
    def sensitivities(self) -> tuple[str, ...]:
        """The law's free parameters."""
        return free_of_model(self.unknowns)

    def comparison(self, law: IdentifiedLaw, near: Found[SpecimenComparison] | None = None) -> SpecimenComparison:
        """Forces beside the recordings, from where their contact seems to be: nothing after that is air."""
        fitted = _fitted(self.folder, self.prepared, self.held_out)
        return self._with_channels(comparison_of(fitted, self.forward, self.folder, self._seeks_ratio))

    def _with_channels(self, forces: SpecimenComparison) -> SpecimenComparison:
        return forces.with_channels([self.folder.test_of(one).sizes_sd for one in forces.recordings])

    def refined(self, search: Search[SpecimenComparison]) -> SpecimenComparison | None:
        """Comparison with contacts moved to where a fit has them, and slopes of its forces; None where all stay."""
        assert search.best.prediction is not None
        now = search.misfit
        moved = self._moved(now, now.aheads(search.best.prediction.values))
        if moved is None:
            return None
        by_itself = comparison_of(moved, self.forward, self.folder, self._seeks_ratio)
        readings = search.law.readings(search.best.point)
        slopes = by_itself.slopes(search.best.prediction.model_values, readings)
        return self._with_channels(comparison_of(moved, self.forward, self.folder, self._seeks_ratio, slopes=slopes))

    def assessed(self, found: Found[SpecimenComparison]) -> Fit[details.SpecimenDetails]:
        """Fit of a finished search."""
        comparison, best, law = found.search.misfit, found.best, found.search.law
        linear = found.linear
        predicted, readings = linear.prediction.values, law.readings(best.point)
        stiffness = comparison.stiffness(linear.prediction, readings)
        apart = 0 if comparison.own is None else comparison.own.degrees
        spread = float(np.sqrt(np.sum(np.log(list(stiffness.values())) ** 2) / apart)) if apart else 0.0
        # Typical specimens of several tests differ by chance, the more the fewer show how much they do.
        by_chance = spread * float(stdtrit(apart, 0.975)) / 1.96 if self.folder.tests and apart else 0.0
        covariance = total_of(comparison.covariances_at(predicted, by_chance))
        covariances = dict(comparison.covariances_at(predicted, spread))
        thickness = goes_with_thickness(comparison, predicted, stiffness)
        rig, on_a_rig = None, OnARig(comparison, linear.prediction.model_values, readings)
        softer = 1.0 if thickness or self.folder.rig else on_a_rig.softened(self.folder)
        begun = on_a_rig.begun_strained(self.folder)
        unseen: dict[ErrorSource, FloatArray] = {"differences": covariances.pop("differences"), "contact": begun}
        if comparison.own is None:
            unseen["sizes"] = self._errors_of_sizes(comparison, model_values(best.values), readings, predicted)
        if self.folder.tests and "sizes" in unseen:
            # Of one test the stiffness takes up what sizes err by.
            covariance = covariance + unseen["sizes"]
        missed, agreement = self._missed(found, covariance)
        covariances["misfit"] = comparison.of_forces_alone(missed.covariance)
        goodness = goodness_of(found, covariance + comparison.thickness_errors, lost=apart)
        fitted = comparison.recordings
        optimum = Optimum(found, covariances, quantile(apart or len(fitted) - 1), goodness.fits, beside=unseen)
        known = estimates(optimum)
        stiffnesses = [(name, one) for name, one in known.items() if name.endswith("C10")]
        if thickness is not None:
            rig = None if self.folder.rig else on_a_rig.yielding(thickness)
            known |= {name: thickness.over(one) for name, one in stiffnesses}
        elif softer > 1.0:
            known |= {name: widened(one, softer - 1.0, 0.0, goodness.fits) for name, one in stiffnesses}
        tests = [
            _test_fit(one, predicted[comparison.is_force & (comparison.part_of == k)], comparison.fits_of(k, predicted))
            for k, one in enumerate(fitted)
        ]
        left_out, told = self._predicted(found, stiffness, readings)
        lateral = lateral_fit(comparison, self.forward, model_values(best.values))
        face = face_fit(comparison, predicted)
        told += [Notice.of(details.SpecimenNotice.MAY_BE_STIFFER, factor=softer)] if softer > _TOLD else []
        told += [Notice.of(details.SpecimenNotice.SIDE_SEEN, text=one.text) for one in (lateral, face) if one]
        why = why_ratio_undetermined(self.folder, fitted) if self._seeks_ratio else ""
        values = self.forward.models[0].with_compressibility(best.values)
        result = Fit(
            kind="specimens",
            subject=Identity(self.folder.id, self.folder.title, self.folder.origin, self.folder.directory),
            law=law.name,
            estimates=MappingProxyType(known),
            correlations=optimum.correlations,
            values=MappingProxyType(values),
            assumed=MappingProxyType(
                {name: value for name, value in values.items() if name not in law.names and np.isfinite(value)}
            ),
            goodness=goodness,
            cost=cost_of(found),
            tests=(*tests, *left_out),
            log=log_of(found),
            neo_hookean_limit=found.neo_hookean_limit,
            settings=search_settings(found.search),
            versions=versions(),
            details=details.SpecimenDetails(
                self.folder,
                self.prepared.left_out,
                comparison.gain_sd(predicted),
                MappingProxyType(stiffness),
                spread,
                missed,
                why,
                thickness,
                lateral,
                face,
                agreement=agreement,
                rig=rig,
            ),
        )
        in_air = [one.name for one in fitted if one.course.in_air]
        undetermined = [Notice.of(details.SpecimenNotice.RATIO_UNDETERMINED, text=why)] if why else []
        found_here = details.notices_about(result, in_air, (*self.prepared.notices, *undetermined, *told))
        unused = (Notice.of(details.SpecimenNotice.NOT_USED, **asdict(one)) for one in self.prepared.left_out)
        doubts = doubts_of(self.folder, self.prepared.c10, self.prepared.doubts)
        return replace(result, notices=(*doubted(doubts), *unused, *found_here))

    def _errors_of_sizes(
        self, comparison: SpecimenComparison, values: Values, readings: FloatArray, predicted: FloatArray
    ) -> FloatArray:
        """Return the covariance (n, n) of predicted readings (n,) by the sizes' errors, each a specimen's own."""
        found = np.zeros((len(predicted), len(predicted)))
        models, of = self.forward.models, comparison.part_of
        specimens = np.array([one.specimen for one in comparison.recordings])[of]
        numbers = np.array([part.test for part in comparison.tests])[of]
        forces_alone = np.where(comparison.is_force, predicted, 0.0)
        for place, test in enumerate(models):
            for name, sd in self._size_errors(test.sizes).items():
                if not sd:
                    continue
                if name in test.sizes.kind.as_force:
                    change = forces_alone
                else:
                    larger = replace(test, sizes=test.sizes.larger(name))
                    outcome = JointForward(tuple(larger if one is test else one for one in models)).solve(values, ())
                    if not comparison.told_by(outcome):
                        continue
                    change = (comparison.predict(outcome, readings).values - predicted) / RESIZED
                mode = sd * np.where(numbers == place, change, 0.0)
                found += np.outer(mode, mode) * (specimens[:, None] == specimens)
        return found

    def _missed(
        self, found: Found[SpecimenComparison], covariance: FloatArray
    ) -> tuple[LawMisfit, TestsAgreement | None]:
        """What the law misses of the forces, beyond errors of a covariance, and how several tests agree on it."""
        comparison, law, prediction = found.search.misfit, found.search.law, found.linear.prediction
        pairs = zip(found.best.point, law.parameters, strict=True)
        scales = [max(abs(value), 1e-3 * one.bounds[1]) for value, one in pairs]
        here, comparison = comparison.is_force, comparison.forces
        jacobian = prediction.jacobian(law.names)[here] * scales
        covariance, force, tests = covariance[np.ix_(here, here)], prediction.values[here], comparison.readings_of
        missed = misfit_of(comparison, covariance, force, jacobian)
        if len(tests) < 2:
            return missed, None
        # A stiffness at its bound has nothing to give way.
        bounds = [bound_of(value, one.bounds) for value, one in zip(found.best.point, law.parameters, strict=True)]
        jacobian = jacobian[:, [not bound for bound in bounds]]
        stiffness = np.array([name not in READINGS for name, bound in zip(law.names, bounds, strict=True) if not bound])
        residual, covariance = comparison.expected - force, covariance.copy()
        best, scale = force.copy(), np.ones_like(force)
        for places in tests.values():
            best[places] += fitted_change(covariance[np.ix_(places, places)], residual[places], jacobian[places])
            scale[places] = max(1.0, float(best[places] @ force[places] / (force[places] @ force[places])))
        # Errors go with the forces, which may be far greater than one set of constants makes them.
        covariance *= np.outer(scale, scale)
        for name, places in tests.items():
            # With constants of its own: what tests differ by is no misfit of the law's.
            at, alone = np.ix_(places, places), comparison.of_test(name)
            covariance[at] += misfit_of(alone, covariance[at], best[places], jacobian[places]).covariance
        return missed, agreement_of_tests(residual, force, jacobian, jacobian[:, stiffness], covariance, tests)

    def _size_errors(self, sizes: Sizes) -> dict[str, float]:
        """Relative errors of the sizes that a test's specimen has, by name."""
        lengths = sizes.lengths
        folder = self.folder.test_of(next(one for one in self.folder.recordings if one.sizes == sizes))
        found = {name: folder.sizes_sd for name in lengths if name.endswith(OF_LAYER)}
        for key, name in sizes.kind.own.items():
            if name in lengths:
                # A diameter is as well known as its radius.
                stated = folder.size_sd.get(key, math.nan) / lengths[name] / (2 if key == "diameter_mm" else 1)
                found[name] = folder.sizes_sd if math.isnan(stated) else stated
        return found

    @property
    def _seeks_ratio(self) -> bool:
        return any(map(is_ratio, self.law.names))

    def _model(self, recordings: Sequence[SpecimenRecording]) -> JointForward[SpecimenForward]:
        tissues, known = tuple(one.of_law(self.law.name) for one in self.folder.tissues), self.prepared
        tests = dict.fromkeys(one.sizes for one in recordings)
        return JointForward(tuple(SpecimenForward(one, known.depths[one], tissues, known.c10) for one in tests))

    def _moved(self, now: SpecimenComparison, aheads: Sequence[float]) -> list[SpecimenRecording] | None:
        """Recordings from where a fit has their contacts; None where all stay."""
        recordings = list(now.recordings)
        moved = list(recordings)
        for k, (one, ahead) in enumerate(zip(recordings, aheads, strict=True)):
            at, (expected, sd) = one.course.contact.displacement, one.detected.expected
            # What is solved goes so deep.
            place = max(min(expected + ahead, one.detected.latest), at + one.course.depth - now.tests[k].depth)
            if abs(place - at) > SETTLED * sd:
                with suppress(InputError):
                    moved[k] = one.begun(place, self.folder.returns)
        return None if moved == recordings else moved

    def _predicted(
        self, found: Found[SpecimenComparison], stiffness: dict[str, float], readings: FloatArray
    ) -> tuple[list[details.RecordingFit], list[Notice]]:
        """Recordings that were left out beside the law, and what is to be said of them."""
        others = [one for one in self.prepared.recordings if one.name in self.held_out]
        missing = self.held_out - {one.name for one in others}
        told = [Notice.of(details.SpecimenNotice.NOT_MODELLED, name=name) for name in sorted(missing)]
        if not others:
            return [], told
        model = self._model(others)
        own = comparison_of(others, model, self.folder, self._seeks_ratio, stiffness)
        outcome = model.solve(model_values(found.best.values), ())
        if not outcome.complete:
            return [], [Notice.of(details.SpecimenNotice.NOT_PREDICTED, reason=outcome.reason), *told]
        seen = own.predict(outcome, readings).values
        return [_test_fit(one, seen[span], fitted=False) for one, span in zip(others, own.spans, strict=True)], told


type _SpecimenFit = Fit[details.SpecimenDetails]

_PLAIN, _USUAL = ParameterRequest(), SearchRequest()


def fit_specimens(
    folder: SpecimenFolder,
    laws: Sequence[LawName],
    asked: ParameterRequest = _PLAIN,
    leave_out: Sequence[str] = (),
    request: SearchRequest = _USUAL,
) -> list[_SpecimenFit]:
    """Fit laws to all recordings of a folder together.

    Parameters
    ----------
    folder : SpecimenFolder
        With recordings.
    laws : sequence of str
        ``neo-hookean``, ``reduced-polynomial``, ``yeoh``, ``exponential``.
    asked : ParameterRequest, optional
        What is to be free or held, in place of the laws' own.
    leave_out : sequence of str
        Names of recordings or specimens that are predicted, and not fitted.
    request : SearchRequest, optional
        Means of the search: settings, folder for kept solves, processes, progress.

    Raises
    ------
    InputError
        If no recording can be modelled, or there is no parameter or recording of a name.
    SearchError
        If too few full solves reach the recordings' depth.
    """
    fitting = _Fitting(asked, request)
    fits = fitting.once(folder, laws, leave_out)
    best = least_akaike(fits).details.agreement
    # Laws can only be compared on the same recordings: where a test stands apart, by the best of them, it does by all.
    shared = best if best is not None and best.apart else None

    def across(joint: _SpecimenFit) -> _SpecimenFit:
        def without(tests: Sequence[str]) -> _SpecimenFit:
            return fitting.once(folder, [joint.law], (*leave_out, *tests))[0]

        agreement = shared or joint.details.agreement
        return joint if agreement is None else details.across_tests(joint, agreement, without, shared is not None)

    return [across(one) for one in fits]


@dataclass(frozen=True)
class _Fitting:
    """What is asked of fits, and their means."""

    asked: ParameterRequest
    request: SearchRequest

    def once(self, folder: SpecimenFolder, laws: Sequence[LawName], leave_out: Sequence[str]) -> list[_SpecimenFit]:
        """Fit laws to all recordings but those that are left out, whether or not tests agree."""
        held = {one for name in leave_out for one in folder.named(name)}
        if len(held) == len(folder.recordings):
            raise InputError(Argument("leave_out"), ", ".join(leave_out), "leave nothing to fit", "name fewer")
        for name in laws:
            free = identified_law(name, folder.tissues, REFERENCE_MPA, folder.longest, self.asked)
            if any(map(is_ratio, free.names)):
                check_strained(folder, [one for one in folder.recordings if one not in held])
        away = frozenset(one.name for one in held)
        if not folder.alternatives:
            return list(self._laws(folder, laws, away))
        kind = next(one.sizes.kind for one in folder.recordings if one.sizes.kind.weighed)
        each = {one: list(self._laws(folder.under(one), laws, away)) for one in folder.alternatives}
        chances = details.probabilities(each)
        return [
            details.weighed({one: fits[k] for one, fits in each.items()}, chances, kind.weighed, kind.to_know)
            for k in range(len(laws))
        ]

    def _laws(self, folder: SpecimenFolder, laws: Sequence[LawName], away: frozenset[str]) -> Iterator[_SpecimenFit]:
        """Fit laws to a folder of which all is known."""
        asked, request = self.asked, self.request
        held = {one for one in folder.recordings if one.name in away}
        prepared = prepare(folder, held, request.out, request.jobs, request.progress)
        fitted = _fitted(folder, prepared, away)
        rates = [[one.course.rate for one in fitted if one.test == test] for test in {one.test for one in fitted}]
        if QUICKENING not in {*asked.names, *asked.priors, *asked.fixed} and not any(map(shows_quickening, rates)):
            asked = replace(asked, fixed={**asked.fixed, QUICKENING: READINGS[QUICKENING].null})
        for name in laws:
            tissues = [one.of_law(name) for one in folder.tissues]
            law = identified_law(name, tissues, prepared.c10, folder.longest, asked)
            (one,) = fit(SpecimenProblem(folder, law, prepared, away), [name], request)
            if rig := one.details.rig:
                (again,) = replace(self, asked=asked)._laws(folder.on_rig(rig.compliance), [name], away)
                one = details.taken_off(again, rig) if again.details.thickness is None else one
            yield one


def _fitted(folder: SpecimenFolder, prepared: Prepared, held_out: frozenset[str]) -> list[SpecimenRecording]:
    """Recordings that are fitted, each from where its contact seems to be: nothing of it then is air."""
    fitted = [one for one in prepared.recordings if one.name not in held_out]
    for k, one in enumerate(fitted):
        found = one.detected
        if not found.known and found.estimate > found.displacement:
            with suppress(InputError):
                fitted[k] = one.begun(found.estimate, folder.returns)
    return fitted


def _test_fit(
    one: SpecimenRecording, predicted: FloatArray, beside: Sequence[ChannelFit] = (), fitted: bool = True
) -> details.RecordingFit:
    channel = one.data.channels[0]
    left = (predicted - channel.values) / channel.sd
    goodness = Goodness.of(float(left @ left), len(left))
    return details.RecordingFit(one.name, (ChannelFit(channel, predicted), *beside), goodness, fitted, recording=one)
