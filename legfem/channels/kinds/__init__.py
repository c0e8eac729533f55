"""Kinds of channel, one way of reading a file."""
