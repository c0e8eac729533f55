"""The paper's Tables 2 and 3 as printed."""

from __future__ import annotations

from dataclasses import dataclass

from legfem.study.doe.factors import Factor

TABLE_2 = (
    Factor("superficial.C10", 1.0, 30.0, "kPa", "linear"),
    Factor("deep.C10", 0.5, 30.0, "kPa", "linear"),
    Factor("deep.C20", 0.5, 30.0, "kPa", "linear"),
    Factor("fascia.C10", 0.1, 10.0, "MPa", "linear"),
    Factor("fascia.thickness", 0.2, 1.0, "mm", "linear"),
)
"""The factors and their ranges."""

MODEL_DOF, ERROR_DOF = 15, 17
"""What 16 coefficients and 33 runs leave."""


@dataclass(frozen=True)
class PrintedRow:
    """One row as printed; forces per unit thickness."""

    metric: str
    ssr: str
    msr: str
    sse: str
    mse: str
    r_squared: str

    @property
    def label(self) -> str:
        """The metric as people read it."""
        kind, start, end = self.metric.split("_")
        return f"{kind} {start}-{end} mm"


TABLE_3 = (
    PrintedRow("curvature_0_5", "9.40e-5", "6.3e-6", "6.7e-7", "4.0e-8", "0.9929"),
    PrintedRow("curvature_5_20", "3.2e-5", "2.1e-6", "1.2e-7", "6.9e-9", "0.9964"),
    PrintedRow("curvature_20_30", "1.8e-4", "1.7e-5", "3.2e-7", "1.9e-8", "0.9982"),
    PrintedRow("slope_0_5", "2.2e-2", "1.5e-3", "2.1e-4", "1.2e-5", "0.9907"),
    PrintedRow("slope_5_20", "5.7e-2", "3.8e-3", "1.1e-4", "6.7e-6", "0.9980"),
    PrintedRow("slope_20_30", "0.19", "1.3e-2", "1.4e-2", "8.0e-4", "0.9336"),
)
