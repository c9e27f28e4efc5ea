"""Pictures of an output folder for people: sheets, gallery, plans, films, before and after."""
