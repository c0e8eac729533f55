"""The 3D correction of the plane-strain force."""
