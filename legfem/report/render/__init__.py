"""Renderers of a page: one for each form that it is given in."""
