"""What may open the truth: score."""
