"""The Processing algorithms, one file each, named after the id."""
