"""The model on a mesh: spaces, forms, symbols, history, fields."""
