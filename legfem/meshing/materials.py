r"""Tissues' laws as Abaqus, CalculiX and FEBio have them.

.. math:: U = \sum_i C_{i0} (\bar I_1 - 3)^i + \sum_i (J - 1)^{2i} / D_i

is Abaqus' reduced polynomial, too: numbers are the same, and so is the bulk modulus K = 2 / D1 (Abaqus Analysis User's
Guide, "Hyperelastic behavior of rubberlike materials"); D2 = 0 leaves its term out. FEBio's ``Yeoh`` with the
``pressure_model`` Abaqus is :math:`\sum_i c_i (\tilde I_1 - 3)^i + k (J - 1)^2 / 2` (its ``FEYeoh.cpp`` and
``FEUncoupledMaterial.h``): c_i = C_i0 and k = 2 / D1. It has no D2, which matters where volume changes much.

Distortion's stress relaxes by branches, :math:`\beta_k e^{-t / \tau_k}` times what lasts. FEBio's g_k are these
:math:`\beta_k`, with g0 = 1. Abaqus' are shares of the stress at once, :math:`g_k = \beta_k / (1 + \sum_j \beta_j)`;
``MODULI=LONG TERM`` says that the law is what lasts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

FEBIO_BRANCHES = 6
"""Of FEBio's viscoelastic material, at most."""


@dataclass(frozen=True)
class TissueCard:
    """A tissue's law.

    Parameters
    ----------
    stiffness : (float, float, float)
        C10, C20 and C30, MPa.
    compressibility : (float, float)
        D1 and D2, 1/MPa; zero without the latter's term.
    branches : sequence of (float, float)
        Relaxing stress over the lasting one, and its time (s).
    """

    stiffness: tuple[float, float, float]
    compressibility: tuple[float, float]
    branches: Sequence[tuple[float, float]] = ()

    def abaqus(self, region: str) -> Iterator[str]:
        """Yield the lines of an Abaqus input file; a section's thickness is 1 mm."""
        (_, c20, c30), (_, d2) = self.stiffness, self.compressibility
        order = 3 if c30 else 2 if c20 or d2 else 1
        numbers = [*self.stiffness[:order], *(*self.compressibility, 0.0)[:order]]
        yield f"*MATERIAL, NAME={region}"
        yield f"*HYPERELASTIC, REDUCED POLYNOMIAL, N={order}" + (", MODULI=LONG TERM" if self.branches else "")
        yield ", ".join(f"{value:.10g}" for value in numbers)
        if self.branches:
            yield "*VISCOELASTIC, TIME=PRONY"
            at_once = 1.0 + sum(ratio for ratio, _ in self.branches)
            yield from (f"{ratio / at_once:.10g}, 0, {time:.10g}" for ratio, time in self.branches)
        yield f"*SOLID SECTION, ELSET={region}, MATERIAL={region}"
        yield "1"

    def febio(self, region: str, number: int) -> str:
        """Return the element of a FEBio model's ``Material``; of more than six branches the fastest are joined."""
        branches, bulk = list(self.branches), 2.0 / self.compressibility[0]
        while len(branches) > FEBIO_BRANCHES:
            (first, early), (second, late), *rest = branches
            branches = [(first + second, early if first > second else late), *rest]
        named, stiffness = f'<material id="{number}" name="{region}"', _series("c", self.stiffness)
        volume = f"<k>{bulk:.10g}</k><pressure_model>Abaqus</pressure_model>"
        if not branches:
            return f'{named} type="Yeoh">{stiffness}{volume}</material>'
        relaxing = "".join(map(_series, "gt", zip(*branches, strict=True)))
        lasting = f'<g0>1</g0>{relaxing}<elastic type="Yeoh">{stiffness}</elastic>'
        return f'{named} type="uncoupled viscoelastic">{volume}{lasting}</material>'


def _series(letter: str, values: Sequence[float]) -> str:
    return "".join(f"<{letter}{k}>{value:.10g}</{letter}{k}>" for k, value in enumerate(values, start=1))
