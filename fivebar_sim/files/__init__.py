"""Files: what is read and its limits, what is written whole or not at all, what ships."""
