"""The parts of a light path as Dr.Jit kernels; no effects."""
