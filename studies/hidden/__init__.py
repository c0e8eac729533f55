"""Effects that a refit of C10 hides: another code's recordings, and what a diagnosis says of them."""
