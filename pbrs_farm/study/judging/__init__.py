"""Figures of a trained network on homes and photographs, beside a baseline and the paper."""
