"""Our renderers beside Open3D and trimesh: the same cameras of the same meshes in one run.

    pip install numpy open3d==0.20.0 trimesh==5.2.0 embreex==4.4.0.post1
    cargo build --release -p semfm-views --example bench_render
    python bench/render_peers.py target/release/examples/bench_render MESH [MESH …]
        [--shots 14x224,12x448,14x512,64x224] [--repeats 5] [--peers "Open3D rays,trimesh + embreex"]

Each peer runs in a process of its own that is pinned to as many processors. Ours draw
triangle, depth and colour of 2 × 2 samples; the rays of Open3D and of trimesh with embreex find
triangle and depth at the pixels' centres, with the rays and the tree given; Open3D's offscreen
renderer draws depth and colour by GL. Times are medians of wall and process CPU milliseconds. `same`
is the share of pixels with our CPU renderer's triangle (of the offscreen renderer: that are covered
or not, as ours), and the run fails where it is below 99 %.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

AGREE = 0.99
PATIENCE = 180  # seconds: Open3D's offscreen renderer hangs now and then on a single processor


def read_shot(folder, who, shot):
    """Triangles and depths of all views, as one of ours drew them."""
    stem = f"{folder}/{who}-{shot['count']}x{shot['size']}"
    shape = (shot["count"], shot["size"], shot["size"])
    triangles = np.fromfile(f"{stem}.triangles.i32", "<i4").reshape(shape)
    return triangles, np.fromfile(f"{stem}.depth.f32", "<f4").reshape(shape)


def pixel_rays(camera, size):
    """Origins and directions of depth 1 through the pixels' centres, in the mesh's frame."""
    rotation, translation = np.array(camera["rotation"]), np.array(camera["translation"])
    u, v = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    x, y = (u - camera["cx"]) / camera["fx"], (v - camera["cy"]) / camera["fy"]
    directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ rotation
    return np.broadcast_to(-rotation.T @ translation, directions.shape), directions


def open3d_rays(vertices, faces, threads):
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(vertices.astype(np.float32), faces)

    def prepare(camera, size):
        origins, directions = pixel_rays(camera, size)
        rays = np.concatenate([origins, directions], axis=-1)
        return o3d.core.Tensor(rays.astype(np.float32))

    def draw(rays):
        hits = scene.cast_rays(rays, nthreads=threads)
        ids = hits["primitive_ids"].numpy().astype(np.int64)
        return np.where(ids == scene.INVALID_ID, -1, ids), hits["t_hit"].numpy()

    return prepare, draw


def trimesh_rays(vertices, faces, threads):
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    shape = trimesh.Trimesh(vertices, faces, process=False)
    scene = RayMeshIntersector(shape)
    normals, anchors = shape.face_normals, shape.triangles[:, 0]

    def prepare(camera, size):
        origins, directions = pixel_rays(camera, size)
        return size, np.array(origins).reshape(-1, 3), directions.reshape(-1, 3)

    def draw(rays):
        size, origins, directions = rays
        ids = scene.intersects_first(origins, directions)
        depth, hit = np.full(len(ids), np.inf), ids >= 0
        normal, anchor = normals[ids[hit]], anchors[ids[hit]]
        along = np.einsum("ij,ij->i", normal, directions[hit])
        with np.errstate(divide="ignore", invalid="ignore"):
            depth[hit] = np.einsum("ij,ij->i", normal, anchor - origins[hit]) / along
        return ids.reshape(size, size), depth.reshape(size, size)

    return prepare, draw


def open3d_offscreen(vertices, faces, threads):
    import open3d as o3d

    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    shape = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces.astype(np.int32))
    )
    shape.compute_vertex_normals()
    material = o3d.visualization.rendering.MaterialRecord()
    material.shader = "defaultLit"
    # Open3D aborts where it takes a renderer down: they live as long as the process.
    renderers = open3d_offscreen.renderers = {}

    def prepare(camera, size):
        if size not in renderers:
            renderers[size] = o3d.visualization.rendering.OffscreenRenderer(size, size)
            renderers[size].scene.add_geometry("object", shape, material)
        intrinsic = np.array(
            [[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]]
        )
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = camera["rotation"], camera["translation"]
        return size, intrinsic, pose

    def draw(camera):
        size, intrinsic, pose = camera
        renderers[size].setup_camera(intrinsic, pose, size, size)
        np.asarray(renderers[size].render_to_image())
        depth = np.asarray(renderers[size].render_to_depth_image(z_in_view_space=True))
        return np.where(np.isfinite(depth), 0, -1), depth

    return prepare, draw


PEERS = {
    "Open3D rays": open3d_rays,
    "trimesh + embreex": trimesh_rays,
    "Open3D offscreen": open3d_offscreen,
}


def agreement(name, ours, theirs):
    """Share of pixels with the same triangle; the depths there must be those, too."""
    (mine, exact), (other, depth) = ours, theirs
    if name == "Open3D offscreen":
        return ((mine >= 0) == (other >= 0)).mean()
    same = mine == other
    seen = same & (mine >= 0)
    off = np.abs(depth[seen] / exact[seen] - 1)
    assert np.quantile(off, 0.999) < 1e-3, f"{name}: depths are {off.max():.1e} off"
    return same.mean()


def told(who, shot, wall, cpu, same):
    per_view = wall / shot["count"]
    print(
        f"  {shot['count']:3} × {shot['size']} {who:18} {wall:9.1f} {per_view:8.2f} {cpu:9.1f} {same:.5f}",
        flush=True,
    )
    if same < AGREE:
        sys.exit(f"{who} draws something else")


def draw_ours(program, path, folder, options):
    """Our renderers on one mesh, timed; `folder` then holds what the peers are given."""
    command = [program, path, "--who", "cpu,driver", "--shots", options.shots]
    command += ["--repeats", str(options.repeats), "--folder", folder]
    environment = os.environ | {"RAYON_NUM_THREADS": str(options.threads)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr)
    report = json.loads(Path(folder, "bench.json").read_text())
    adapters = [time["adapter"] for time in report["times"] if "adapter" in time]
    print(f"{Path(path).stem}: {options.threads} threads; driver: {', '.join(adapters) or 'none'}")
    print(f"  {'views':9} {'':18} {'wall ms':>9} {'a view':>8} {'CPU ms':>9} same")
    for timed in (time for time in report["times"] if "count" in time):
        ours = [read_shot(folder, who, timed) for who in ("cpu", timed["who"])]
        same = agreement(timed["who"], *ours)
        told(f"ours, {timed['who']}", timed, timed["wall_ms"], timed["cpu_ms"], same)


def draw_peer(name, folder, options):
    """One peer on the mesh and the cameras in `folder`."""
    report = json.loads(Path(folder, "bench.json").read_text())
    vertices = np.fromfile(f"{folder}/vertices.f64", "<f8").reshape(-1, 3)
    faces = np.fromfile(f"{folder}/faces.u32", "<u4").reshape(-1, 3)
    try:
        prepare, draw = PEERS[name](vertices, faces, options.threads)
        draw(prepare(report["shots"][0]["cameras"][0], report["shots"][0]["size"]))
    except (ImportError, RuntimeError) as error:
        print(f"  {name}: does not start ({error})")
        return
    for shot in report["shots"]:
        cameras = [prepare(camera, shot["size"]) for camera in shot["cameras"]]
        draw(cameras[0])  # shaders and pages
        times = []
        for _ in range(options.repeats):
            start = time.perf_counter(), time.process_time()
            answers = [draw(camera) for camera in cameras]
            times.append((time.perf_counter() - start[0], time.process_time() - start[1]))
        wall, cpu = np.median(np.array(times), axis=0) * 1e3
        theirs = tuple(np.stack(part) for part in zip(*answers))
        told(name, shot, wall, cpu, agreement(name, read_shot(folder, "cpu", shot), theirs))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the example bench_render of semfm-views, built")
    parser.add_argument("meshes", nargs="+", metavar="MESH")
    parser.add_argument("--shots", default="14x224,12x448,14x512,64x224")
    parser.add_argument("--peers", default=",".join(PEERS), help="(default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, help="only this many (default: one, then all)")
    parser.add_argument("--peer", nargs=2, help=argparse.SUPPRESS)  # name and folder: one process each
    options = parser.parse_args()
    allowed = sorted(os.sched_getaffinity(0))
    again = [sys.executable, *sys.argv]
    if options.threads is None:
        for threads in sorted({1, len(allowed)}):
            subprocess.run([*again, "--threads", str(threads)], check=True)
        return
    os.sched_setaffinity(0, allowed[: options.threads])  # before any library starts its threads
    if options.peer:
        draw_peer(*options.peer, options)
        sys.stdout.flush()
        os._exit(0)  # and the process ends without taking anything down
    for path in options.meshes:
        with tempfile.TemporaryDirectory() as folder:
            draw_ours(options.program, path, folder, options)
            for name in options.peers.split(","):
                try:
                    subprocess.run([*again, "--peer", name, folder], check=True, timeout=PATIENCE)
                except subprocess.TimeoutExpired:
                    print(f"  {name}: not done after {PATIENCE} s")


if __name__ == "__main__":
    main()
