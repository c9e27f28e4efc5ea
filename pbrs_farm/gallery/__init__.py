"""Contact sheet, HTML gallery and label sheet of an output folder."""
