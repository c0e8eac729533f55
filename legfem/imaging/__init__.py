"""From images and surfaces of a leg to its shape, and back: scans, registration."""
