"""What further channels are worth on the same sealed recordings, beside force alone."""
