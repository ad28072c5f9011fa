"""The scores and the debrief, which use the truth after the day is handed in."""
