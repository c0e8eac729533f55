"""Errors as labs have them: wider than the diagnosis assumes, and of other shapes."""
