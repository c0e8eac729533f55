"""A second code, felupe: its laws, its steps and contact, and a leg and a bar by it."""
