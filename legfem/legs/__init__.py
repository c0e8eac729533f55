"""A leg as kind of problem: its folder, its model in plane strain and in 3D, its laws, what is known of it."""
