"""The search over designs: methods, the front, and what is kept on disk while it goes on."""
