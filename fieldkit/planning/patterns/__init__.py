"""Patterns of passes over trials: what they are worth, and which are best."""
