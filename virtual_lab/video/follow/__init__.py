"""Blobs to flights: pieces of constant acceleration, one joint fit, contacts, kinds of motion."""
