"""``python -m virtual_lab``."""

from virtual_lab.cli import main

main()
