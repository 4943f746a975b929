"""Small meshes for examples and tests."""

from ._semfm import icosphere, torus

__all__ = ["icosphere", "torus"]
