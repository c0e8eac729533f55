"""What is seen of a pressed leg beside its force: kinds of channel, and how each is read off a solved state."""
