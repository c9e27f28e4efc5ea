"""OpenUSD: how it is read."""
