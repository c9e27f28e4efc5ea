"""What a browser shows of a view's stored files: thumbnails, coloured labels, pixels, light."""
