"""The pictures; the only importers of matplotlib in this package."""
