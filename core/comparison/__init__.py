"""JPG, RAW and their enhanced versions of one flight, side by side."""
