"""Fixtures of these tests."""

from tests.photo_fixture import photo_file as photo_file
