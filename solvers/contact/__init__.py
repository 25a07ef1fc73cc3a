"""Contact at one instant, and the source's iteration."""
