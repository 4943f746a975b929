"""A stand-in for a checkout of SAM 3D Objects, and a scene whose truth it knows.

It honours the interface (``notebook/inference.py``, the configuration, types and frames of what
goes in and comes out) and answers with the truth in a frame of its own: the camera-frame points of
what a mask marks, expressed as the real one expresses them. All of it runs in a process of its own,
since it brings a module
``torch`` of a few lines.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import semfm
import semfm.zoo
from PIL import Image

#: Kept apart from our code: rows times matrices, as PyTorch3D multiplies, and the two constants of
#: the real one (z up to y up in ``to_glb``; x and y turned in ``camera_to_pytorch3d_camera``).
INTERFACE = """
import os
os.environ["CUDA_HOME"] = os.environ["CONDA_PREFIX"]
import json
import numpy as np
import sam3d_objects
import torch
import trimesh
from scipy.spatial.transform import Rotation

print("loading, said on stdout")

class Inference:
    def __init__(self, config_file, compile=False):
        folder = os.path.dirname(config_file)
        with open(os.path.join(folder, "truth.json")) as file:
            self.truth = json.load(file)

    def __call__(self, image, mask, seed=None, pointmap=None):
        print("running, said on stdout")
        assert image.dtype == np.uint8 and image.shape == (*mask.shape, 3) and mask.dtype == bool
        np.concatenate([image[..., :3], mask.astype(np.uint8)[..., None] * 255], axis=-1)
        if self.truth.get("fails"):
            raise RuntimeError(self.truth["fails"])
        [thing] = [t for t in self.truth["things"] if mask[tuple(t["pixel"])]]
        points = np.array(thing["points"]) * [-1, -1, 1]
        unit = 3.7
        if pointmap is not None:
            assert isinstance(pointmap, torch.Tensor) and pointmap.array.dtype == np.float32
            assert pointmap.array.shape == image.shape and not np.isinf(pointmap.array).any()
            seen = np.nanmedian(pointmap.to("cpu").array[mask], axis=0)
            reach = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
            off = np.linalg.norm(seen - points.mean(axis=0))
            assert off < reach, f"the point map is elsewhere: {seen} for {points.mean(axis=0)}"
            unit = 1.0
        points = unit * points
        random = np.random.default_rng([seed, len(points)])
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        w, x, y, z = quaternion
        R = Rotation.from_quat([x, y, z, w]).as_matrix()
        scale, shift = random.uniform(0.2, 0.9), points.mean(axis=0) + random.normal(size=3) * 0.02
        upright = (points - shift) @ np.linalg.inv(R) / scale
        assert np.allclose(scale * upright @ R + shift, points)
        glb = trimesh.Trimesh(
            upright @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), thing["faces"], process=False
        )
        glb.visual.vertex_colors = np.linspace(0, 1, 3 * len(points)).reshape(-1, 3)
        if self.truth.get("no_mesh"):
            glb = None
        return {
            "glb": glb,
            "rotation": torch.Tensor(quaternion[None]),
            "translation": torch.Tensor(shift[None]),
            "scale": torch.Tensor(np.full((1, 3), scale) * self.truth.get("stretch", [1, 1, 1])),
        }
"""

TORCH = """
class Tensor:
    def __init__(self, array):
        self.array = array
    def to(self, device):
        return self
    def detach(self):
        return self
    def cpu(self):
        return self
    def numpy(self):
        return self.array

def from_numpy(array):
    return Tensor(array)
"""

CAMERA = {"fx": 300.0, "fy": 310.0, "cx": 110.0, "cy": 80.0}
SIZE = (240, 180)
#: Colours, sRGB from 0 to 1.
MUG_COLOR = (0.35, 0.5, 0.75)
SKIN = (0.9, 0.7, 0.58)


@dataclass(frozen=True)
class Scene:
    """A mug and a hand on its handle, as files and as truth in the camera's frame."""

    folder: Path
    mug: semfm.Mesh
    hand: semfm.Mesh

    def words(self, *names: str) -> list[str]:
        """The options of the files, as ``--mask mask.png``."""
        files = {"mask": "mask.png", "hand-mask": "hand.png"}
        files.update({"depth": "depth.npy", "intrinsics": "K.json"})
        return [word for name in names for word in (f"--{name}", str(self.folder / files[name]))]

    @property
    def picture(self) -> str:
        return str(self.folder / "picture.png")

    @property
    def reference(self) -> str:
        """The mug without the hand."""
        return str(self.folder / "reference.png")

    @property
    def checkout(self) -> Path:
        return self.folder / "checkout"

    def change(self, **truth: object) -> None:
        """Changes how the stand-in answers."""
        path = self.checkout / "checkpoints/hf/truth.json"
        path.write_text(json.dumps({**json.loads(path.read_text()), **truth}))


def make_scene(folder: Path, instance: int = 0) -> Scene:
    """Writes the files. Nothing stands in the middle of the picture: no wrong sign goes unseen."""
    demo = semfm.demo_object("containers", instance=instance, n_vertices=1500)
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    scale = 0.14 / demo.mesh.diagonal
    mug = semfm.Mesh(scale * demo.mesh.vertices @ turn.T + [0.045, 0.02, 0.5], demo.mesh.faces)
    grip = mug.vertices[demo.region.vertices].mean(axis=0)
    ball = semfm.zoo.icosphere(4)
    hand = semfm.Mesh(ball.vertices * [0.02, 0.05, 0.02] + grip + [0.0, 0.0, -0.015], ball.faces)
    camera = semfm.Pinhole.with_pixel_centres_at_integers(*SIZE, *CAMERA.values())
    views = [
        semfm.render(mesh, [camera], colors=np.tile(color, (mesh.n_vertices, 1)))[0]
        for mesh, color in ((mug, MUG_COLOR), (hand, SKIN))
    ]
    depths = [np.asarray(view.depth, dtype=np.float64) for view in views]
    nearest = np.minimum(*depths)
    masks = [np.isfinite(depth) & (depth == nearest) for depth in depths]
    picture = np.where(masks[1][..., None], views[1].rgb, views[0].rgb)
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(folder / "picture.png")
    Image.fromarray(views[0].rgb).save(folder / "reference.png")
    for name, mask in zip(("mask", "hand"), masks):
        Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(folder / f"{name}.png")
    np.save(folder / "depth.npy", np.where(np.isfinite(nearest), nearest, 0).astype(np.float32))
    (folder / "K.json").write_text(json.dumps(CAMERA))
    scene = Scene(folder, mug, hand)
    things = [
        {
            "points": mesh.vertices.tolist(),
            "faces": mesh.faces.tolist(),
            "pixel": [int(i) for i in np.argwhere(mask)[mask.sum() // 2]],
        }
        for mesh, mask in zip((mug, hand), masks)
    ]
    _write_checkout(scene.checkout, things)
    return scene


def _write_checkout(folder: Path, things: list[dict]) -> None:
    for name, text in {
        "notebook/inference.py": INTERFACE,
        "sam3d_objects/__init__.py": "",
        "torch.py": TORCH,
        "checkpoints/hf/pipeline.yaml": "stand_in: true\n",
        "checkpoints/hf/truth.json": json.dumps({"things": things}),
    }.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
