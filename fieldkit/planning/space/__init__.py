"""Sets of cameras: where they may be, families of them, and how they are coded."""
