"""Measurements of clients, page and object changes on a live server: `python -m benchmarks.live.NAME`."""
