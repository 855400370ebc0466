"""Files that Python reads and writes: solution files, and meshes that the extension does not know."""
