"""The command ``legfem diagnose``, and the callable ``legfem.diagnose(...)``."""
