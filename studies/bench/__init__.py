"""What legfem costs: counts, which don't depend on the machine, and seconds of the processor."""
