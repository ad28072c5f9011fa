"""Blobs to flights: pieces of constant acceleration, one joint fit, a ruler, contacts, doubts."""
