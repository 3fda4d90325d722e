"""Modules that every package may use."""
