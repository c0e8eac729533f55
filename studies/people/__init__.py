"""Fat and muscle of living people: how stiff they are, and how much people differ."""
