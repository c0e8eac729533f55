"""What every room uses: errors, units, checks, progress, documents, tables, TOML."""
