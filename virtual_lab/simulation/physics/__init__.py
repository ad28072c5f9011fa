"""Physical models of bat and ball: beam, modes, force law, ageing. True side only."""
