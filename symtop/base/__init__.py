"""Ground floor: checks of input, labelled datasets."""
