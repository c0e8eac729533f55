"""How simulated data are made: legs, scans, another code, and a lab that records with errors."""
