"""An output folder in the forms other tools read: COCO, HDF5, WebDataset, the released layout."""
