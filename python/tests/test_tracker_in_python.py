"""`semfm.Tracker`: an object followed through frames, with the lines that the shell writes."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest
import semfm
from observed_frames import HEIGHT, WALL, WIDTH, K, in_metres, seen, shell, turned

#: Frames in which the object is away.
AWAY = (5, 6, 7)
N_FRAMES = 10


@pytest.fixture(scope="module")
def mug():
    return in_metres(semfm.demo_object("containers", n_vertices=1500).mesh, 0.2)


@pytest.fixture(scope="module")
def frames(mug):
    """A mug that moves to the right and is away for a while, before a wall."""

    def frame(i):
        time = 2 * 10**9 + 33_000_000 * i
        if i in AWAY:
            wall = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
            return semfm.Observation(
                K, color=wall, depth=np.full((HEIGHT, WIDTH), WALL), time_nanos=time
            )
        mesh = turned(mug, [0.004 * i - 0.02, 0.0, 0.6], 40.0 + 2 * i)
        return seen(mesh, time_nanos=time)

    return [frame(i) for i in range(N_FRAMES)]


def test_lines_are_those_of_the_shell(mug, frames, tmp_path):
    mug.write(tmp_path / "mug.obj")
    region = semfm.Region.from_mask(mug.vertices[:, 0] > 0.03)
    region.write(tmp_path / "region.json", mug)
    semfm.write_observations(tmp_path / "seen.mcap", frames)
    made = shell(
        "track", tmp_path / "mug.obj", tmp_path / "seen.mcap", "-o", tmp_path / "track.jsonl", "--scale", 1,
        "--region", tmp_path / "region.json", "--refined", tmp_path / "refined.json", "--seed", 3,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    tracker = semfm.Tracker(
        tmp_path / "mug.obj", scale=1.0, region=tmp_path / "region.json", seed=3, hypotheses=96
    )
    poses = [tracker.update(seen) for seen in semfm.read_observations(tmp_path / "seen.mcap")]
    lines = (tmp_path / "track.jsonl").read_text().splitlines()
    assert [pose.to_json() for pose in poses] == lines
    tracker.refined_region.write(tmp_path / "python.json", tracker.mesh)
    assert (tmp_path / "python.json").read_bytes() == (tmp_path / "refined.json").read_bytes()
    assert [pose.frame for pose in poses] == list(range(N_FRAMES))
    assert poses[0].state == "new" and poses[1].state == "tracking"
    assert all(poses[i].state == "lost" and poses[i].camera_from_object is None for i in AWAY)
    assert all(poses[i].scale is None and poses[i].covariance is None for i in AWAY)


def test_a_pose_says_where_and_how_sure(mug, frames):
    tracker = semfm.Tracker(mug, scale=1.0)
    poses = [tracker.update(frame) for frame in frames[:3]]
    last = poses[-1]
    truth = turned(mug, [0.004 * 2 - 0.02, 0.0, 0.6], 44.0).vertices
    placed = mug.vertices @ last.camera_from_object[:3, :3].T + last.camera_from_object[:3, 3]
    assert np.linalg.norm(placed - truth, axis=1).mean() < 0.01
    assert last.time_nanos == frames[2].time_nanos and 0.5 < last.probability <= 1
    assert last.covariance.shape == (6, 6) and np.allclose(last.covariance, last.covariance.T)
    assert 0 < last.position_std < 0.05 and last.scale == pytest.approx(1)
    np.testing.assert_allclose(last.rigid, last.camera_from_object, atol=1e-9)
    assert last.region is None and tracker.refined_region is None
    assert last.evidence["visible_share"] > 0.5 and last.to_dict() == json.loads(last.to_json())
    assert pickle.loads(pickle.dumps(last)) == last != poses[0]
    assert repr(last).startswith("TrackedPose(frame 2: tracking, at ")
    # From a known pose, in another unit, and with what was found as the start of another tracker.
    small = semfm.Mesh(mug.vertices * 1000, mug.faces)
    init = last.camera_from_object @ np.diag([1e-3, 1e-3, 1e-3, 1])
    again = semfm.Tracker(small, init=init).update(frames[2])
    assert again.state in ("new", "tracking") and again.scale == pytest.approx(1e-3)


def test_threads_and_errors_leave_a_tracker_as_it_should_be(mug, frames):
    tracker = semfm.Tracker(mug, scale=1.0)
    assert tracker.update(frames[1], mask="object").state == "new"
    with pytest.raises(semfm.InvalidInput, match="later than"):
        tracker.update(frames[0])
    with pytest.raises(semfm.InvalidInput, match="a depth image, found colour alone"):
        tracker.update(semfm.Observation(frames[0].camera, color=frames[0].color))
    with pytest.raises(semfm.InvalidType, match="an Observation"):
        tracker.update(frames[0].depth)
    # A frame without a mask of the name does not show the object, or nobody said so.
    assert tracker.update(frames[2], mask="cup").state == "tracking"
    timeless = semfm.Observation(frames[3].camera, depth=frames[3].depth)
    found = []
    threads = [
        threading.Thread(target=lambda: found.append(tracker.update(timeless).frame))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(found)) == 4
    with pytest.raises(semfm.InvalidInput, match="hypotheses"):
        semfm.Tracker(mug, hypotheses=0)
    with pytest.raises(semfm.InvalidInput, match="scale"):
        semfm.Tracker(mug, scale=-1.0)


BUSY = """
import itertools, os, signal, threading, time
import numpy as np
import semfm, semfm.zoo

ball = semfm.zoo.icosphere(4)
rng = np.random.default_rng(0)
k = [[300, 0, 319.5], [0, 300, 239.5], [0, 0, 1]]
# A heap without any ball in it: sought all over the picture.
heap = 1.0 - 0.3 * rng.random((12, 16)).repeat(40, axis=0).repeat(40, axis=1)
frame = semfm.Observation(k, depth=heap)
tracker = semfm.Tracker(ball, scale=0.05, hypotheses=10000)
"""

INTERRUPTED = """
def interrupt():
    time.sleep(0.5)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    for n_done in itertools.count():
        tracker.update(frame)
except KeyboardInterrupt:
    after = tracker.update(semfm.Observation(k, depth=np.ones((480, 640))))
    # The frame that was interrupted counts.
    print(after.frame - n_done, after.state)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_an_interrupted_tracker_goes_on_with_the_next_frame():
    run = subprocess.run(
        [sys.executable, "-c", BUSY + INTERRUPTED], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == ["1", "lost"]


ASKED_WITHIN = """
signal.signal(signal.SIGALRM, lambda *_: tracker.refined_region)
signal.setitimer(signal.ITIMER_REAL, 0.05, 0.05)
try:
    while True:
        tracker.update(frame)
except semfm.InvalidInput as error:
    signal.setitimer(signal.ITIMER_REAL, 0)
    print(error)
    print(tracker.update(frame).state)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_a_call_from_within_another_does_not_wait_for_it():
    run = subprocess.run(
        [sys.executable, "-c", BUSY + ASKED_WITHIN], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    error, state = run.stdout.splitlines()
    assert "one from within it" in error and state == "lost"
