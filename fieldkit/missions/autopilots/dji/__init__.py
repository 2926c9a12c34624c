"""DJI: missions as WPML files, and what its apps and Litchi make of waypoints."""
