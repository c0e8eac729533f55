"""Bounds on the work of a curve: counts, which don't depend on the machine."""

from studies.bench import work_of


def test_a_30_mm_curve_takes_at_most_60_factorisations(subject_3_test):
    work = work_of(subject_3_test)
    assert work.report.complete
    assert work.report.contact_stiffness_factor == 1.0
    assert work.report.rejected == 0
    assert work.report.factorisations <= 60
    assert work.report.iterations <= 280
    # SNES' own evaluations at states just evaluated are saved.
    assert work.evaluations <= 1.3 * work.report.iterations
