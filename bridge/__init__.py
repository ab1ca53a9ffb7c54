"""The door to the engine: where it is, the environment it gets, its process, and what goes in and out."""
