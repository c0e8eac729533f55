"""Legs that are drawn and scanned by computer, for studies with a known truth."""
