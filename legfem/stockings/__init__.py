"""Legs in compression stockings: equilibrium of leg and fabric, stiffness from scans, pressures at the veins."""
