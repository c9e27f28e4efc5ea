"""SourceRef -> finished House: the passes that read, furnish, dress, repair and edit a home."""
