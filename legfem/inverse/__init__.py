"""Inverse problems: what was measured beside what a model predicts, and what that says of its parameters."""
