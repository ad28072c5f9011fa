"""The scores and the debrief: the truth opened once the day is handed in."""
