"""Sealed cases: recordings in which left-out physics is concealed, to prove the diagnosis on."""
