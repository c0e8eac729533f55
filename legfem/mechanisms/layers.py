"""Layers over the muscle: fat of another stiffness, or that slides; fascia and skin of another tension than assumed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from legfem.common.units import kpa_to_mpa
from legfem.geometry.section import MUSCLE
from legfem.inverse.advice import LabStep, either, recorded
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, factor, strength

FAT_IMAGED = LabStep("image the fat's thickness under load", recorded("fat_thickness", "section_displacement"))


class SuperficialStiffness(TissueMechanism):
    """The fat's stiffness, over the one given."""

    name = "superficial-stiffness"
    needs = MUSCLE
    statement = "the superficial tissue (fat) is stiffer or softer than assumed"
    parameters = (factor("factor", "on C10", (0.1, 9.0), 0.9, "reported stiffness of fat differs tenfold"),)
    scaled = ("superficial.C10",)
    would_be = "fat of {} times the assumed stiffness"
    alters_nuisances = True
    steps = (LabStep("press gently with a small tip (2 mm deep)"), FAT_IMAGED)
    next_experiment = either(*steps)
    measured_sd = 0.25
    """An estimate."""
    strengths = (0.4, 1.7, 3.5, 8.0)


class FatStiffening(TissueMechanism):
    """A second and a third coefficient of the fat's energy, where the model has one."""

    name = "superficial-stiffening"
    needs = MUSCLE
    statement = "the superficial tissue (fat) stiffens as it is squeezed"
    parameters = (strength("coefficient", "kPa", "of the fat's energy's third power", 3.0, (0.0, 60.0)),)
    steps = (replace(FAT_IMAGED, words=f"{FAT_IMAGED.words}, at several depths"),)
    next_experiment = either(*steps)
    strengths = (1.0, 6.0, 25.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the fat with more coefficients of its energy."""
        from legfem.mechanics.materials import Yeoh
        from legfem.mechanics.terms import Tissue

        return [Tissue("superficial", Yeoh.of(leg.tissues.superficial))]

    def solution(self, values: Values) -> Solution:
        """Return the law with its third coefficient."""
        return Solution(parameters={"superficial.C30": kpa_to_mpa(values["coefficient"])})


_FREEST, _HALF, _POWER = 0.01, 0.56, 1.5
"""kPa/mm: what the face bears along itself where it is as free as it gets, and what more half of the way there. Fat a
centimetre thick bears some 0.4 kPa/mm. With that power the force changes in proportion to the share of the way."""
_LEAST = 1e-3
"""Share of the way below which nothing slides."""


class FatSliding(TissueMechanism):
    r"""Sliding of the fat over the fascia between none (grown together) and free, on a face that doesn't open.

    A share s of the way to free, the face bears along itself, over the way that its two sides slid,

    .. math:: k = k_0 + k_{1/2} \left(\frac{1 - s}{s}\right)^{3/2}.

    Free of all, fat could turn round the leg, which what holds it beyond the section doesn't let it.
    """

    name = "fat-sliding"
    needs = MUSCLE
    statement = "the fat slides along the fascia: the two are not grown together"
    parameters = (strength("sliding", "-", "share of the way from grown together to free", 0.6, (0.0, 1.0)),)
    would_be = "fat that slides along the fascia, {} of the way to free"
    next_experiment = "film fat and fascia with ultrasound beside the cylinder while it presses"
    steps = (LabStep(next_experiment, recorded("section_displacement")),)
    measured_sd = 0.2
    """An estimate: speckle is followed to some 0.3 mm beside ways of one or two."""
    variant = "fat slides"
    strengths = (0.4, 0.78)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the face."""
        from legfem.mechanics.terms import SlidingFace

        return [SlidingFace()]

    def solution(self, values: Values) -> Solution:
        """Return the model whose fat slides so far; without sliding it is the base model."""
        share = values["sliding"]
        if share < _LEAST:
            return Solution()
        borne = _FREEST + _HALF * ((1.0 - share) / share) ** _POWER
        return Solution(self.variant, {"sliding.shear": kpa_to_mpa(borne)})


class FasciaStiffness(TissueMechanism):
    """The fascia's stiffness times thickness, over the one given."""

    name = "fascia-stiffness"
    needs = MUSCLE
    statement = "the fascia is stiffer, softer, thicker or thinner than assumed"
    parameters = (
        factor(
            "factor",
            "stiffness times thickness over the assumed one",
            (0.05, 50.0),
            1.4,
            "crural fascia is reported from 0.1 to 100 MPa",
        ),
    )
    scaled = ("fascia.C10",)
    would_be = "a fascia of {} times the assumed stiffness"
    alters_nuisances = True
    next_experiment = "measure the fascia by shear-wave elastography"
    measured_sd = 0.4
    """An estimate: a sheet thinner than a wave is long."""
    strengths = (0.2, 3.0, 9.0, 26.0)


class FasciaPrestress(TissueMechanism):
    """Tension of the fascia in the imaged state."""

    name = "prestress"
    needs = MUSCLE
    statement = "the fascia was under tension before the test"
    parameters = (strength("tension", "kPa", "tension of the fascia at rest", 100.0, (0.0, 500.0)),)
    would_be = "a fascia under a tension of {}"
    alters_nuisances = True
    next_experiment = "measure the pressure in the compartment at rest, or shear-wave speeds along the fascia"
    measured_sd = 40.0
    """An estimate: 1 kPa of pressure times the fascia's radius over its thickness."""
    strengths = (20.0, 100.0, 300.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the fascia's tension."""
        from legfem.mechanics.terms import Prestress

        return [Prestress(leg.section.fascia)]

    def solution(self, values: Values) -> Solution:
        """Return the model with the tension."""
        return Solution(parameters={"fascia.prestress.tension": kpa_to_mpa(values["tension"])})


class DermisTension(TissueMechanism):
    """The dermis as a membrane on the fat, which both papers leave out.

    At 1 mm of dermis, Young's modulus under suction (129 kPa on the forearm; Diridollou et al.
    2000) gives 0.04 N/mm, C10 of the reticular dermis (0.16 MPa; Hendriks et al. 2006) 0.3 N/mm,
    and C10 from indentation with images (1.11 MPa; Tran et al. 2007) 2 N/mm.
    """

    name = "dermis"
    statement = "the skin bears tension: it is a sheet stiffer than the fat under it"
    parameters = (
        strength(
            "stiffness",
            "N/mm",
            "shear modulus of the dermis times its thickness",
            0.3,
            (0.0, 3.0),
            "Diridollou 2000, Hendriks 2006 and Tran 2007: 0.04 to 2 N/mm",
        ),
    )
    would_be = "a skin of a stiffness of {}"
    alters_nuisances = True
    next_experiment = "lift the skin with a suction cup, or stretch it between two pads, beside the indenter"
    measured_sd = 0.1
    """An estimate: a third of a usual stiffness."""
    strengths = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the membrane."""
        from legfem.mechanics.terms.membranes import Dermis

        return [Dermis()]

    def solution(self, values: Values) -> Solution:
        """Return the model with the membrane's stiffness."""
        return Solution(parameters={"dermis.stiffness": values["stiffness"]})
