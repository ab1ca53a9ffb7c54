"""Photographs: reading them, their EXIF and XMP, and the local contrast enhancement."""
