"""Orientation and georeferencing."""
