"""What a leg's model may leave out, one mechanism a file; others come by entry points."""

from __future__ import annotations

from legfem.diagnose.mechanisms.base import Mechanism, Solution, Stiffness, TissueMechanism, Values
from legfem.diagnose.mechanisms.registry import mechanism_named, mechanisms

__all__ = ["Mechanism", "Solution", "Stiffness", "TissueMechanism", "Values", "mechanism_named", "mechanisms"]
