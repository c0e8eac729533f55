"""Many legs, specimens or stockings: who they are, what was found of each, and what that says of all."""
