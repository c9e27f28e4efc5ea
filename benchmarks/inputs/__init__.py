"""Houses in formats of others, written in code for tests and the benchmark of inputs."""
