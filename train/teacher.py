"""The teacher: an encoder that is already there, whose features are fused on the surface.

Any ENCODER.json of docs/encoders.md will do. The shipped net was taught by MobileNetV2
(ImageNet, Apache-2.0), outputs of stride 16 and of the stride-32 stage run at stride 16.
"""

from __future__ import annotations

import numpy as np
import semfm
from semfm.sidecar.coverage import patch_coverage
from semfm.sidecar.onnx_encoder import open_onnx
from semfm.sidecar.patches import embed_pictures

#: Quarter turns by turns: half a circle apart within a view, a quarter between neighbouring views,
#: so that the fused field has seen all four at the price of two.
_ROLLS = ((0, 2), (1, 3))
#: Points of the fused field; the pipeline's own default.
N_SAMPLES = 1200


class Teacher:
    """Fuses an encoder's tokens on the surface of a mesh."""

    def __init__(self, encoder_json: str, threads: int = 1) -> None:
        self._encoder = open_onnx(encoder_json, "cpu", threads)
        self.name, self.revision = self._encoder.name, self._encoder.revision

    def fused_field(self, mesh: semfm.Mesh, views: list[semfm.View]) -> semfm.SemanticCloud:
        """The mean token of every view that sees a point, in two turns, at about 1200 points."""
        patches = []
        for parity, rolls in enumerate(_ROLLS):
            pictures = np.stack([view.rgb for view in views[parity::2]])
            embedded = embed_pictures(self._encoder, pictures, rolls)
            for view, data, valid in zip(views[parity::2], embedded.data, embedded.valid):
                coverage = patch_coverage(view.triangles >= 0, embedded.grid)
                rect = embedded.grid.rect
                patches.append(semfm.PatchEmbeddings(data, rect, coverage=coverage, valid=valid))
        cameras = [view.camera for parity in (0, 1) for view in views[parity::2]]
        embeddings = semfm.Embeddings(mesh, cameras, patches, encoder=self.name)
        return semfm.lift(mesh, embeddings, n_samples=N_SAMPLES)
