"""A laboratory of another maker: its form, its tables, and the answer they were made from."""
