"""What really happens: bats, balls, machines, instruments and faults; the truth is theirs."""
