"""Two worked examples: physics that the first paper left out, found in simulated recordings."""
