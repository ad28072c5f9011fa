"""Studies of tests, which may read the truth (score, coverage, bias), of bats and the catalog."""
