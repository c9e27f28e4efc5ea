"""A house as flat tables that the kernels gather from; pure numpy."""
