"""legfem: the stiffness of leg soft tissue from indentation tests, on FEniCSx."""
