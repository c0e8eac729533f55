"""Cases whose truth is known, drawn, spoiled, run, scored and counted by one machine from a table of kinds."""
