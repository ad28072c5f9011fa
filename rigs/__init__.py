"""The machines of this laboratory, one file each, found through entry points like anybody's."""
