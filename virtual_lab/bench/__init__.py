"""The rehearsal bench: a laboratory day taken by a person or an operator, action by action."""
