"""What identification, diagnosis and stockings share of statistics."""
