"""What bat and ball are made of: beam, modes, ball law, swing. True side only."""
