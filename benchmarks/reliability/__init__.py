"""Measurements of how the server copes with disturbances: `python -m benchmarks.reliability.NAME`.

Each starts real server processes on free loopback ports, ends by itself, prints its figures and writes them as JSON.
`docs/reliability.md` holds the results. The tests of the same matters assert nothing about time.
"""
