"""One leg pressed at several sites: its tissues from all of them together."""
