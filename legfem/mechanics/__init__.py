"""The physics as UFL: kinematics, materials, terms, contact. No mesh, no solver."""
