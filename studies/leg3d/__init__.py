"""Recordings of a leg in 3D by another discretisation, identified by both models."""
