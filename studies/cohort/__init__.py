"""What a cohort's population model and its engines do, with known truths; nothing is solved."""
