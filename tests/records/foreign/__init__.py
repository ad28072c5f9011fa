"""Tests of another laboratory's records."""
