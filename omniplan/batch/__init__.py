"""Many twists and many pairs at once, in numba."""
