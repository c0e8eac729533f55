"""When model and recording differ: where, which physics was left out, and what adding it does."""
