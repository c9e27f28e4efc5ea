"""From a folder of views to a trained network: reading, training, evaluation and comparison."""
