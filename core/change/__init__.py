"""Change: alignment, differences, volumes and their uncertainty."""
