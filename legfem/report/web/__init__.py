"""``report.html``: one page a run, whole in one file, opened from the disk without a network."""
