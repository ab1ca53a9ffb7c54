"""Tie points: features, pairs, matching, statistics."""
