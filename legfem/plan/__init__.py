"""The command ``python -m legfem.plan``."""
