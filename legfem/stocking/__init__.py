"""Compression stockings: what they do to a leg, and what images of it tell of its tissues."""
