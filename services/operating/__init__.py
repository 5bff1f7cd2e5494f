"""How a server is configured, started and followed."""
