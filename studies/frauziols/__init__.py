"""Frauziols et al.: claims of their design of experiments, costs of their fits, and the model's own error."""
