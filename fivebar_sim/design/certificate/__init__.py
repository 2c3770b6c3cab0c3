"""Certificates: bounds of reach, singularity and condition between the samples, not by sampling."""
