"""The link to a vehicle: uploading a mission, and starting it."""
