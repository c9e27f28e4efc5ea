"""Data sets as files: what a set's file asks for is rendered, split, exported and summed; what it costs."""
