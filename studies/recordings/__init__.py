"""Public recordings of meat and phantoms, diagnosed."""
