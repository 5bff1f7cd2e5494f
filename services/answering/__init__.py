"""From a request to its replies."""
