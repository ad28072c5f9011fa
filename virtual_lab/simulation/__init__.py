"""The simulation: true bats, balls, machines, instruments and faults."""
