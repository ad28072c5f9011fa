"""What a laboratory knows: from raw records to a judged result; never sees the truth."""
