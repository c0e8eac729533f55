"""``python -m legfem.data``: looking at instruments' files."""
