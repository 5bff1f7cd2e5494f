"""The one room that imports zenoh."""
