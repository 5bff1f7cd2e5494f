"""What is said: keys, messages in JSON and Arrow, addresses."""
