"""Files: size limits of inputs, atomic writes, and the folders that ship with the package."""
