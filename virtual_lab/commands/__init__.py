"""The commands of this program, for the command line and the page: table, calls, results."""
