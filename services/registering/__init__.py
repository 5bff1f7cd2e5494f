"""Which vehicles there are: kept, versioned, shared among servers."""
