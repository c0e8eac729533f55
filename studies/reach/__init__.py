"""Whether any leg can be pressed to its depth, and how good the curve between steps is."""
