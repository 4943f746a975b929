"""Labelled meshes from pictures, as the paper made its data.

Per object a picture and a region in words; an image endpoint puts a hand there, masks of hand and
object follow from what changed, both are reconstructed, and what the hand touches is the label::

    semfm-dataset plan.json -o data
    semfm-cli eval data/objects -o report

How it is done, and where to read about it:

1. :mod:`.plan` reads what is to be made;
2. :mod:`.image_endpoint` asks for pictures, :mod:`.masks` finds hand and object in them,
   :mod:`.commands` runs programs of one's own in place of a stage;
3. :mod:`.stages` are the stages of one object, :mod:`.run` goes through all objects.
"""

from .masks import masks_of_change
from .plan import PlannedObject, read_plan
from .run import run_plan
from .stages import Makers

__all__ = ["Makers", "PlannedObject", "masks_of_change", "read_plan", "run_plan"]
