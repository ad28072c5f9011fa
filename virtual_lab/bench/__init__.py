"""The rehearsal bench: a test day carried out by a person or an operator, action by action."""
