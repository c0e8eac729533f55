"""The commands: what each reads, calls and prints."""
