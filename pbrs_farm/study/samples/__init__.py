"""Torch datasets of views from an output root or from shards, with a resumable order."""
