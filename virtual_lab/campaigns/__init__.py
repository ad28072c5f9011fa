"""Campaigns: studies of many laboratories, stored on disk in parts that workers compute.

Nothing is imported here, so that a worker process can answer its parent before slow imports.
"""
