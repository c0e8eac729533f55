"""From a model on a mesh to a path: Newton, linear solvers, steps, sensitivities."""
