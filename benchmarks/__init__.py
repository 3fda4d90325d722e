"""Measurements that take minutes, each run from the top of the checkout; README.md lists them."""
