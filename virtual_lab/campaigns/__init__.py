"""Campaigns: studies of many laboratories on disk, made part by part, by one worker or many.

Nothing is imported here: a worker's process listens for its parent before it loads what it needs.
"""
