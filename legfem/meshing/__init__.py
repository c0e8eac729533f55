"""Meshes by gmsh."""
