"""Standstills: representations, ways of the wheels and their time, full turns."""
