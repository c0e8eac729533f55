"""Identification: from recordings to the deep tissue's stiffness with its uncertainty."""
