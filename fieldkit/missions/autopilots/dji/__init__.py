"""DJI: missions as WPML files."""
