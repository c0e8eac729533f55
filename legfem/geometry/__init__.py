"""Leg sections: contours, their checks, smooth curves, and conversion from surfaces' sections."""
