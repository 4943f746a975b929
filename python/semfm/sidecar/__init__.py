"""The sidecar: turns rendered views into patch embeddings with a pretrained image encoder.

Models live in Python, geometry lives in Rust, and between them stand MCAP files::

    semfm-cli views  mug.obj -o mug.views.mcap
    semfm-embed      mug.views.mcap -o mug.emb.mcap --model google/siglip2-base-patch16-224

The same from Python::

    from semfm.sidecar import embed_file, open_encoder
    encoder = open_encoder("mobilenet.json")
    embed_file("mug.views.mcap", "mug.emb.mcap", encoder)

How a view becomes a grid of vectors, and where to read about it:

1. :class:`semfm.ViewsFile` reads and checks the views: pictures, triangle images, cameras;
2. every picture is shown to the encoder upright and rolled by 90, 180 and 270 degrees
   (:mod:`.patches`); an encoder is anything that keeps the small promise of :mod:`.encoder`:
   :mod:`.onnx_encoder`, :mod:`.lite0`, :mod:`.siglip`, :mod:`.dinov2`, or a class of your own;
3. per roll, tokens of outlying norm are dropped and the others scaled to unit length; the grids
   are rolled back and averaged (:mod:`.patches`);
4. :mod:`.coverage` says how much of each patch the object fills, and :class:`semfm.Embeddings`
   writes everything, whole or not at all.

The base install needs neither torch nor onnxruntime: they are imported when an encoder is opened.
"""

from .embed import EmbedSettings, embed_file
from .encoder import Encoder, Grid
from .errors import SidecarError
from .models import open_encoder

__all__ = ["EmbedSettings", "Encoder", "Grid", "SidecarError", "embed_file", "open_encoder"]
