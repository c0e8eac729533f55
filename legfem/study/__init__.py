"""Studies: what a model's numbers rest on."""
