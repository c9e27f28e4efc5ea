"""The board: pages in a browser that show an output root, relight its views and steer a farm."""
