"""What factors and iterations cost in 3D."""
