"""The command ``python -m legfem.diagnose``, and the callable ``legfem.diagnose(...)``."""
