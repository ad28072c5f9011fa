"""The machines of the laboratory: what each action makes them write; the truth is here."""
