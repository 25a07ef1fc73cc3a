"""What convinces: published values, benchmarks, stability, errors against run time, scaling."""
