"""The parts of the command line: what it reads and what it prints."""
