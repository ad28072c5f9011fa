"""Studies: what may open the truth (score, coverage, bias), and what a bat or a shelf holds."""
