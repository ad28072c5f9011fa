"""The page of all commands on this computer: forms, runs and results in a browser."""
