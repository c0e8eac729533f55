"""The design of experiments: which parameters a compression test can see."""
