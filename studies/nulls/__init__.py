"""Recordings without any left-out physics: how often some is named all the same."""
