"""ManipNet Live: fingers synthesised live from tracked wrists and objects."""

__version__ = "0.1.0"
