"""Specimens in a lab's test: their folder, and their tissue's law from recordings of them."""
