"""Folders of subjects: their schema, loading them, those that come with legfem."""
