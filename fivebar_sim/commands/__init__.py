"""The commands of `fivebar`, one a file: call, print, return the exit status."""
