"""How far the default settings are from convergence."""
