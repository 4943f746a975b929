"""SemFM: carry a grasp region from one object to another by semantic functional maps."""

__version__ = "0.1.0"
