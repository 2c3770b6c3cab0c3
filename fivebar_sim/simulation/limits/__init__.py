"""Torque limits that are kept in every step."""
