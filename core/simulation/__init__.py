"""Simulated surveys with known truth: terrain, camera, flight."""
