"""Whether the intervals cover planted truths."""
