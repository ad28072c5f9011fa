"""The measurement side: from raw records to a result with a verdict; it never sees the truth."""
