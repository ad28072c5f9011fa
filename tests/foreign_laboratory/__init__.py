"""A laboratory of another maker: its form, its tables, and the known answer."""
