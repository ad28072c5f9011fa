"""The measurement side: from raw records to a result with a verdict, without the truth."""
