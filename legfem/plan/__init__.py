"""The next experiment, reckoned: which test would tell explanations apart, and how probably."""
