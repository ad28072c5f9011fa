"""The day: what can be done, what it leaves behind, what can be read off it; no truth."""
