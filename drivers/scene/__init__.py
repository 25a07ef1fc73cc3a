"""From a TOML file to checked parameters."""
