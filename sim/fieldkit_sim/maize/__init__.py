"""Procedural maize plants."""
