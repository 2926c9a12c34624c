"""Missions in the words of autopilots, and what autopilots make of them."""
