"""Stored radiance -> pictures: denoising, white balance, tone mapping."""
