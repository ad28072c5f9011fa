"""Other evaluations of one test: other propagation, other swing laws, other support."""
