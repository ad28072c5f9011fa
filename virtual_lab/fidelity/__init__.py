"""Speed against accuracy: what each method costs and how far off it is."""
