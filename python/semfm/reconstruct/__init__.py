"""From a picture and masks to meshes of the object and the hand in one camera's frame.

::

    semfm-reconstruct photo.jpg --mask mug.png --hand-mask hand.png \\
        --depth depth.png --intrinsics K.json -o out

The meshes are made by SAM 3D Objects where it is installed, by a class of one's own, or elsewhere
(``--mesh``, ``--pose``). How one picture is done, and where to read about it:

1. :mod:`.observation` reads picture, masks and depth through ``semfm-cli frames``;
2. :mod:`.tools` opens the tool, :mod:`.sam3d` is the one that comes with SemFM;
3. :mod:`.poses` turns its conventions into ours, :mod:`.placed_mesh` holds a mesh with its pose;
4. :mod:`.fit` draws the meshes over the picture and says how they agree;
5. :mod:`.output` writes the folder and says what to run next.
"""

from .placed_mesh import PlacedMesh, place_mesh
from .poses import read_pose
from .tools import ReconstructionTool

__all__ = ["PlacedMesh", "ReconstructionTool", "place_mesh", "read_pose"]
