"""The methods, one file each, as short as in Hoffmann (2002)."""
