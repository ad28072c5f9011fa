"""Common code of all printed output: numbers, tables, style, templates."""
