"""The fastest timing of a path (TOPP-RA)."""
