"""What stands in an output root, as rows of an SQLite file that answer within milliseconds."""
