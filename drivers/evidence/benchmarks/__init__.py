"""Published benchmarks of plates and shells."""
