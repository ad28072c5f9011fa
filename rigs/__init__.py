"""The rigs of this project, one file each, found through entry points like any others."""
