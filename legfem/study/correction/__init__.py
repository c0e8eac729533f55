"""Calibrates the 3D correction on the idealised leg."""
