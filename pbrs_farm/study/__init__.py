"""From a folder of views to a trained network: reading, training and judging; only torch's parts import torch."""
