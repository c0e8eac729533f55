"""The second paper's six legs: simulated scans, identification, and its claims."""
