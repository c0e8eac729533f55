"""A leg by tape: its pressures against closed forms, 3D and scans; what is refused; fabrics for many legs."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from making_stocking import COARSEST, GIRTHS, HEIGHTS, laws, short_leg, write_scanned, write_shape, write_tape

import legfem as lf
from legfem.common.errors import InputError
from legfem.common.units import mmhg_to_mpa, mpa_to_mmhg
from legfem.geometry.leg_shape import LegShape, perimeter
from legfem.inverse.intervals import quantile
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.equilibrium import EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import ANKLE_LIMITS, Stocking, fitted_stocking, stocking_load
from legfem.stockings.leg import StockingLeg
from legfem.stockings.levels import fewest
from legfem.stockings.loading import LEGS, load_leg
from legfem.stockings.tape import GIVES, GIVES_SD, TapeDetails, rings


def worn(folder: Path) -> TapeDetails:
    return TapeDetails(load_leg(folder))


def test_the_pressure_at_each_level_is_laplaces_on_a_leg_that_gives_way(tmp_path: Path) -> None:
    girth, unstretched = np.array([*GIRTHS.values()]), np.array([158.0, 205.0, 288.0, 280.0])
    bare = 2 * np.pi * 0.3 * (1 / unstretched - 1 / girth)
    left = girth * (1 - 0.014 * bare / mmhg_to_mpa(25.0))
    expected = mpa_to_mmhg(2 * np.pi * 0.3 * (1 / unstretched - 1 / left))
    found = worn(write_tape(tmp_path)).at_levels
    assert [one.level for one in found] == [*GIRTHS] and [one.height_mm for one in found] == [*HEIGHTS.values()]
    assert [one.mean_pressure_mmHg for one in found] == pytest.approx(expected, rel=1e-3)
    assert found[2].over_pressure_at_B == pytest.approx(expected[2] / expected[0], rel=1e-3)


def test_its_interval_has_the_errors_of_fabric_tape_and_of_how_far_legs_give_way(tmp_path: Path) -> None:
    """By finite differences of Laplace's law, where the code takes its derivative."""
    one, leg = worn(write_tape(tmp_path)).at_levels[0], load_leg(tmp_path)

    def pressure(girth: float, taken: float = GIVES) -> float:
        bare = 2 * np.pi * 0.3 * (1 / 158 - 1 / girth)
        return float(mpa_to_mmhg(2 * np.pi * 0.3 * (1 / 158 - 1 / (girth * (1 - taken * bare)))))

    by = [0.05 * one.mean_pressure_mmHg, one.mean_pressure_mmHg * 0.01 / np.sqrt(8)]
    by += [pressure(215 * 1.012) - pressure(215), pressure(215) - pressure(215, GIVES + GIVES_SD)]
    low, high = one.ci95_mmHg
    assert high - low == pytest.approx(2 * quantile(0) * np.linalg.norm(by), rel=0.1)
    sure = TapeDetails(replace(leg, girth_sd=1e-6, accuracy=replace(leg.accuracy, tension_sd=0.0))).at_levels[0]
    assert sure.ci95_mmHg[1] - sure.ci95_mmHg[0] < 0.6 * (high - low)


@pytest.mark.parametrize("kpa", [(1.0, 2.0), (4.0, 12.0)])
def test_the_tapes_interval_holds_what_a_leg_solved_for_in_3d_has(kpa: tuple[float, float]) -> None:
    shape = short_leg()
    fabric = fitted_stocking(shape, "2")
    solved = EquilibriumSolver(LegModel3D(shape, laws(*kpa), COARSEST), fabric).solve().load
    levels = shape.levels[[1, 4, 8, 11]]
    along = TapeDetails(by_tape(shape, levels, fabric)).pressure_along
    in_3d = np.interp(levels, shape.levels, mpa_to_mmhg(solved.pressure.mean(axis=1)))
    assert (np.abs(along.mean - in_3d) < quantile(0) * along.sd).all()
    assert (quantile(0) * along.sd < 0.25 * along.mean).all()


def by_tape(shape: LegShape, levels: np.ndarray, fabric: Stocking) -> StockingLeg:
    """Return the leg of which a tape measured a shape's girths at levels."""
    bare = rings(levels, np.interp(levels, shape.levels, perimeter(shape)))
    known = ("a", "A leg", "simulated", bare, bare, None, None, fabric, ContourAccuracy(), {}, True, "held")
    return StockingLeg(*known, levels, (), girth_sd=0.012)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["1", "5"])
def test_girths_of_a_shipped_leg_give_an_interval_that_holds_its_scan_in_the_stocking(name: str) -> None:
    leg = load_leg(LEGS.find(name))
    assert leg.compressed is not None
    levels = np.linspace(leg.bare.levels[2], leg.bare.levels[-3], 4)
    along = TapeDetails(by_tape(leg.scanned_bare, levels, leg.stocking)).pressure_along
    scan = mpa_to_mmhg(stocking_load(leg.compressed, leg.stocking).pressure.mean(axis=1))
    assert (np.abs(along.mean - np.interp(levels, leg.compressed.levels, scan)) < quantile(0) * along.sd).all()


@pytest.mark.parametrize("change", ["stiffness", "size"])
def test_a_leg_by_tape_in_the_fabric_that_meets_a_class_has_that_class(tmp_path: Path, change: str) -> None:
    details = worn(write_tape(tmp_path))
    (one,) = (each for each in details.fabrics if each.compression_class == "3")
    first = details.leg.stocking
    chosen = replace(first, stiffness=one.stiffness_N_per_mm[0])
    if change == "size":
        chosen = replace(first, unstretched=first.unstretched * one.unstretched_mm_at_B[1] / 158.0)
    again = TapeDetails(replace(details.leg, stocking=chosen)).at_levels[0]
    assert again.mean_pressure_mmHg == pytest.approx(34.0, rel=0.02)
    assert one.stiffness_N_per_mm == pytest.approx([0.3 * factor for factor in one.tension_factor], rel=1e-9)


def test_a_leg_by_tape_is_answered_without_a_mesh(tmp_path: Path) -> None:
    found = lf.stocking(write_tape(tmp_path / "leg"), out=tmp_path / "out")
    text = found.summary()
    assert "At the ankle (B) the stocking presses with" in text and "class 2 (23 to 32 mmHg)" in text
    report = " ".join(found.write(tmp_path / "out").read_text().split())
    assert "residual pressure ratio: 69 %" in report and "girths by tape: 215 mm (z = 120 mm)" in report
    assert "greatest round the leg" not in report and "1.2 % of each girth" in report
    again = lf.read_result(tmp_path / "out")
    assert again.kind == "tape" and again.laws["neo-hookean"].computed["pressure_at_B"].unit == "mmHg"
    assert not list((tmp_path / "out").glob("*.xdmf")) and (tmp_path / "out" / "along.png").is_file()


def test_a_fabric_that_is_slack_at_the_ankle_presses_above(tmp_path: Path) -> None:
    toml = write_tape(tmp_path / "leg") / "leg.toml"
    toml.write_text(toml.read_text().replace('unstretched = "stocking.csv"', "unstretched_mm = 300.0"))
    found = lf.stocking(tmp_path / "leg", out=tmp_path / "out")
    at = {one.level: one for one in TapeDetails(load_leg(tmp_path / "leg")).at_levels}
    assert at["B"].mean_pressure_mmHg == 0.0 and at["C"].mean_pressure_mmHg > 5.0
    assert at["C"].over_pressure_at_B is None
    report = found.write(tmp_path / "out").read_text()
    assert "the fabric is wider than the leg at 2 of 4 levels" in " ".join(report.split())


@pytest.mark.parametrize(
    ("change", "field", "said"),
    [
        (
            ("B = 120.0, B1 = 190.0, C = 310.0, D = 390.0", "B = 12.0, B1 = 19.0, C = 31.0, D = 39.0"),
            "levels_mm",
            "in cm",
        ),
        (("{B = 215.0, B1 = 268.0, C = 362.0", "{B = 362.0, B1 = 268.0, C = 215.0"), "girths_mm", "exchanged"),
        (("{B = 215.0, B1 = 268.0", "{B = 268.0, B1 = 215.0"), "girths_mm", "exchanged"),
    ],
)
def test_what_is_unlikely_of_a_tape_is_doubted(tmp_path: Path, change: tuple[str, str], field: str, said: str) -> None:
    toml = write_tape(tmp_path) / "leg.toml"
    assert not load_leg(tmp_path).doubts
    text = toml.read_text().replace('unstretched = "stocking.csv"', "unstretched_mm = 200.0")
    assert change[0] in text
    toml.write_text(text.replace(*change))
    doubts = [one for one in load_leg(tmp_path).doubts if field in one.field]
    assert [one for one in doubts if said in str(one)]


@pytest.mark.parametrize(
    ("change", "field", "said"),
    [
        (
            ("tension_relative_sd = 0.05", "tension_relative_sd = 5.0"),
            "tension_relative_sd",
            "at most 0.5 (0.05 is 5 %)",
        ),
        (("tension_relative_sd = 0.05", "contour_sd_mm = 5.0"), "contour_sd_mm", "at most 3, in mm"),
        (("tension_relative_sd = 0.05", "correlation_mm = 100.0"), "correlation_mm", "at most 60, in mm"),
        (("tension_relative_sd = 0.05", "pressure_relative_sd = 1.0"), "pressure_relative_sd", "at most 0.5"),
        (("tension_relative_sd = 0.05", "girth_relative_sd = 1.2"), "girth_relative_sd", "at most 0.2"),
        (("B = 215.0", "B = 21.5"), "bare.girths_mm.B", "100"),
        (
            ("bare.girths_mm", 'compressed.scan = "x.nii.gz"\nbare.girths_mm'),
            "compressed",
            "no effect on a leg by tape",
        ),
        (("levels_mm = {B = 120.0, ", "levels_mm = {"), "stocking.levels_mm.B", "give the height of each girth"),
        (("B1 = 190.0", "B1 = 100.0"), "levels_mm.B1", "100 mm is not above B"),
        (("{B = 215.0, B1 = 268.0, C = 362.0, D = 345.0}", "{B = 215.0}"), "bare.girths_mm", "2"),
        (("{B = 215.0,", "{E = 215.0,"), "bare.girths_mm", "E"),
        (("158", "1580"), "", ""),
        (('intended_class = "2"', "limits_percent = {C = [0.5, 0.8]}"), "limits_percent.C", "at least 2"),
    ],
)
def test_what_no_tape_says_is_refused_by_its_field(
    tmp_path: Path, change: tuple[str, str], field: str, said: str
) -> None:
    toml = write_tape(tmp_path) / "leg.toml"
    toml.write_text(toml.read_text().replace(*change))
    if not field:
        (tmp_path / "stocking.csv").write_text("level_mm,perimeter_mm\n120,1580\n390,1580\n")
        field, said = "leg.toml: stocking.unstretched", "is wider than the leg"
    with pytest.raises(InputError, match=r"leg.toml|stocking") as raised:
        load_leg(tmp_path)
    assert field in str(raised.value) and said in str(raised.value)


def unread_second_scan(folder: Path, shape: LegShape) -> Path:
    """Write a leg whose second scan can't be read, so that whoever comes so far is told of that."""
    toml = write_scanned(folder) / "leg.toml"
    write_shape(shape, folder / "bare.csv")
    (folder / "broken.nii.gz").write_bytes(b"no scan")
    toml.write_text('compressed.scan = "broken.nii.gz"\n' + toml.read_text().replace("tissues =", "#"))
    return folder


def test_cells_and_segment_are_refused_before_the_second_scan_is_read(tmp_path: Path) -> None:
    shape = short_leg()
    folder = unread_second_scan(tmp_path, shape)
    with pytest.raises(InputError, match=r"broken.nii.gz.*can't be read"):
        load_leg(folder, cells=15_000)
    with pytest.raises(InputError, match="cannot be meshed with 2000 tetrahedra; choose from"):
        lf.stocking(folder, cells=2_000)
    with pytest.raises(InputError, match="cells: 1000: is not possible here; give 2000 to 5000000"):
        lf.stocking(tmp_path / "nowhere", cells=1_000)
    toml = (folder / "leg.toml").read_text()
    (folder / "leg.toml").write_text(toml + "[segment]\nfrom_mm = 70.0\n")
    with pytest.raises(InputError, match=r"segment: is 40 mm long"):
        load_leg(folder)
    (folder / "leg.toml").write_text(toml + "[segment]\nfrom_mm = 10.0\n")
    with pytest.raises(InputError, match=r"segment.from_mm: 10 mm is not in what the scans share, 50 to 110 mm"):
        load_leg(folder)


def test_no_fewer_values_lie_in_all_spans() -> None:
    """Beside trying all choices of ends, for a hundred draws of up to seven spans."""
    rng = np.random.default_rng(11)
    for _ in range(100):
        lows = rng.uniform(0, 10, rng.integers(1, 8))
        spans = [(float(low), float(low + width)) for low, width in zip(lows, rng.uniform(0.2, 4, 7), strict=False)]
        found = list(fewest(spans))
        assert all(any(low <= value <= high for value, _ in found) for low, high in spans)
        assert [count for _, count in found] == [sum(a <= value <= b for a, b in spans) for value, _ in found]
        ends = [high for _, high in spans]
        least = next(
            size
            for size in range(1, 8)
            for some in combinations(ends, size)
            if all(any(low <= end <= high for end in some) for low, high in spans)
        )
        assert len(found) == least
    assert list(fewest([(2.0, np.inf), (3.0, np.inf)])) == [(3.0, 2)]
    assert list(fewest([(0.0, 120.0), (0.0, 110.0)])) == [(110.0, 2)]


def test_a_cohort_says_which_fabric_meets_each_class_and_the_fewest_that_serve_all(tmp_path: Path) -> None:
    sizes = {"a": 200.0, "b": 203.0, "c": 260.0}
    for name, girth in sizes.items():
        write_tape(tmp_path / "study" / name, {level: girth / 215 * one for level, one in GIRTHS.items()})
    found = lf.cohort(tmp_path / "study", do="stocking", out=tmp_path / "out")
    table = found.to_frame().set_index("member")
    told = {one.compression_class: one for one in worn(tmp_path / "study" / "c").fabrics}["2"]
    for name in ("stiffness_N_per_mm", "unstretched_mm_at_B"):
        least, greatest = (table.loc["c", f"class_2_{end}_{name}"] for end in ("least", "greatest"))
        assert (least, greatest) == pytest.approx(getattr(told, name))
    at_ankle = worn(tmp_path / "study" / "a").at_levels[0]
    assert table.loc["a", "neo_hookean_pressure_at_B_mmHg"] == pytest.approx(at_ankle.mean_pressure_mmHg)
    page = " ".join(found.write(tmp_path / "out").read_text().split())
    assert "Which fabric meets a class" in page and "Pressure at B: " in page
    (said,) = re.findall(r"- class 2 \(23 to 32 mmHg\), unstretched girth at B \(mm\): ([^-]*)", page)
    assert re.fullmatch(r"1[34]\d \(on 2 of 3\), 1[6-9]\d \(on 1 of 3\) ", said)


def test_french_classes_are_lighter_than_the_same_numbers_of_ral() -> None:
    ral, french = ANKLE_LIMITS["RAL-GZ 387"], ANKLE_LIMITS["NF G 30-102 B"]
    assert french["2"] == (15.1, 20.0) and french["2"][1] < ral["2"][0]
    for limits in ANKLE_LIMITS.values():
        ends = [end for one in limits.values() for end in one]
        assert ends == sorted(ends) and ends[-1] == np.inf


@pytest.mark.parametrize(
    ("rows", "said"),
    [("120,158", "there is one level"), ("120,158\n120,160\n390,280", "the level 120 mm is given twice")],
)
def test_what_is_wrong_with_a_table_of_the_fabric_names_it(tmp_path: Path, rows: str, said: str) -> None:
    (write_tape(tmp_path) / "stocking.csv").write_text(f"level_mm,perimeter_mm\n{rows}\n")
    with pytest.raises(InputError, match=rf"stocking\.csv: .*{said}"):
        load_leg(tmp_path)
