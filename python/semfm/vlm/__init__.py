"""The paper's baseline: ask a vision-language model where the region is.

Several views of the source with its region drawn in red, as many of the target, one question; the
answer names the region in each target view, as polygons or as numbers of patches drawn on it, and
is lifted onto the mesh::

    semfm-cli views mug.obj -o mug.views.mcap
    semfm-cli views jug.obj -o jug.views.mcap
    semfm-vlm mug.views.mcap jug.views.mcap --region handle.json -o region.json

The same from Python::

    from semfm.vlm import ChatEndpoint, from_environment, read_object, read_region, transfer
    source, target = read_object("mug.views.mcap"), read_object("jug.views.mcap")
    outcome = transfer(
        source, target, read_region("handle.json", source), 6, ChatEndpoint(from_environment())
    )

How a pair is done, and where to read about it:

1. :mod:`.object_views` reads mesh, cameras and what each pixel shows; :mod:`.choose_views` picks
   views spread well apart;
2. :mod:`.marking` draws the pictures (:mod:`.segments` cuts the target into patches), and
   :mod:`.question` puts them between the words in ``prompts/``;
3. :mod:`.endpoint` asks through :mod:`.client`, :mod:`.cache` keeps replies, and
   :mod:`.true_masks` answers with the truth to measure the ceiling of everything but the model;
4. :mod:`.answer` reads the reply strictly, and :mod:`.lifting` lifts its masks onto vertices by
   visibility and vote;
5. :mod:`.baseline` does one pair, :mod:`.run` many, :mod:`.rows` is their file.

The base install does not need the ``openai`` client: it is imported when an endpoint is opened.
"""

from .baseline import BaselineSettings, Failure, Outcome, transfer
from .cache import CachedEndpoint
from .endpoint import ChatEndpoint, EndpointSettings, from_environment
from .object_views import ObjectViews, read_object
from .region import read_region
from .true_masks import TrueMasks

__all__ = [
    "BaselineSettings",
    "CachedEndpoint",
    "ChatEndpoint",
    "EndpointSettings",
    "Failure",
    "ObjectViews",
    "Outcome",
    "TrueMasks",
    "from_environment",
    "read_object",
    "read_region",
    "transfer",
]
