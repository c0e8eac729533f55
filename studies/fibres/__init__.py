"""How muscle fibres along the leg change the force of a short cylinder."""
