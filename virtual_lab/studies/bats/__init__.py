"""What is computed of bats from their properties, without a test."""
