"""The same test evaluated another way: other propagation, other swing laws, other support."""
