"""The command ``legfem plan``."""
