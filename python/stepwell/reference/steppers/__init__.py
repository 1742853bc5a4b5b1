"""The methods, one file each, as short as in the document."""
