"""Step reports: self-contained HTML with pictures, no network."""
