"""The day: actions, their consequences, and readings, without the truth."""
