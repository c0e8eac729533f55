"""The proofs: what the claims in the READMEs rest on, each a command ``python -m studies.NAME``."""
