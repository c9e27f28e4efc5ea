"""How good a trained network is, on homes and on photographs, beside a baseline and the paper."""
