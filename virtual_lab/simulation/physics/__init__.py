"""Physical models of bat and ball: beam, modes, force law, aging. True side only."""
