"""Another code's legs with effects, recorded anew with a lab's errors: what the diagnosis says."""
