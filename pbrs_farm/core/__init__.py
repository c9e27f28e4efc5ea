"""The nouns: frozen values and the conventions they keep; no I/O."""
