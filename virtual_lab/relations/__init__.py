"""Closed forms that both the true and the measuring side need; they know of neither."""
