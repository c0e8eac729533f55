"""Experiments: parameters and a protocol in, a force-displacement curve out."""
