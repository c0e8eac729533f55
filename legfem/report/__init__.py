"""Reports: text, figures and files of fields."""
