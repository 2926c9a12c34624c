"""Building references, scoring captures against them, and the files that say how it went."""
