"""Files of text that people and programs write, read with limits: JSON and TOML."""
