"""The scenes that come with stepwell, one file each."""
