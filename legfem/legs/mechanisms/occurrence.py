"""How strong what may be left out of a leg's model can be, and how common that is: one table, with its sources.

Ranges are those of living legs and of rigs as labs have them, not those at which a simulation ends. Of `strong` effects
(anywhere in the range, evenly in the logarithm of a factor) nobody has counted how many there are, for any of these:
the shares are set, and so is that an effect is as common as any other unless `Mechanism.expected` says otherwise. An
entry whose source is empty has none; it is what someone who watches a test would still overlook.
"""

from collections.abc import Mapping

from legfem.inverse.mechanism import Occurrence

OCCURRENCES: Mapping[str, Occurrence] = {
    "uneven-muscle": Occurrence(
        0.25,
        10.0,
        0.5,
        "a slack tendon's shear modulus is some 80 kPa (9.1 m/s in 182 Achilles tendons, BMC Musculoskelet. Disord. 19 "
        "(2018), doi 10.1186/s12891-018-2056-0) and aponeuroses run through the calf (Slane et al., Eur. Radiol. 27 "
        "(2017) 474): more than ten times a relaxed muscle's; from there on a lump is as good as rigid. Softer: fat or "
        "fluid within the muscle",
    ),
    "superficial-stiffness": Occurrence(
        0.1,
        5.0,
        0.25,
        "0.2 to 10 kPa, over the 2 kPa that is usual: shear moduli of 0.5 kPa (Sims et al., Biomech. Model. "
        "Mechanobiol. 9 (2010) 703) and 0.75 kPa at rest (ten buttocks by magnetic resonance, J. Mech. Behav. Biomed. "
        "Mater. 2023); Young's modulus of 26 ± 19 kPa under load (J. Phys. Ther. Sci. 34 (2022) 777)",
    ),
    "fascia-stiffness": Occurrence(0.05, 50.0, 0.0, "crural fascia is reported from 0.1 to 100 MPa"),
    "compressibility": Occurrence(0.1, 60.0, 0.0, "reported bulk moduli of muscle differ a hundredfold"),
    "fat-sliding": Occurrence(0.0, 1.0, 0.0, "between fat that is grown to the fascia and fat without friction on it"),
    "poroelastic-drainage": Occurrence(0.0, 3000.0),
    "dermis": Occurrence(0.0, 2.0, 0.0, "Diridollou 2000, Hendriks 2006 and Tran 2007: 0.04 to 2 N/mm"),
    "indenter-tilt": Occurrence(-12.0, 12.0, 0.0),
    "contact-slip": Occurrence(0.0, 1.0, 0.0, "between a skin that sticks and one without friction"),
    "support-compliance": Occurrence(0.0, 1.0, 0.0),
    "leg-movement": Occurrence(-4.0, 4.0, 0.0),
    "muscle-contraction": Occurrence(0.0, 1.0, 0.0),
    "preconditioning": Occurrence(-0.3, 0.6, 0.0),
}
