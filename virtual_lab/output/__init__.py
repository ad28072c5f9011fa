"""What all printing shares: numbers, tables, style, templates."""
