"""Plans that a vehicle can drive: moves, the search, the answer."""
