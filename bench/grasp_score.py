"""Fits and judges the score of a grasp by trials in MuJoCo (bench/physics.py).

    python bench/grasp_score.py collect FOLDER [--shared ../shared] [--semfm semfm-cli] [--random 6]
    python bench/grasp_score.py fit FOLDER
    python bench/grasp_score.py judge FOLDER
    python bench/grasp_score.py diversity FOLDER

``collect`` asks for 100 random survivors of each object and hand (``grasp --random``), tries some of them at
the usual grip (friction .5, 30 N a pad, the object's own mass) and, for the calibration, under another
friction, force or mass each, and keeps everything in FOLDER: a later call goes on where an earlier one
stopped. ``fit`` fits log-odds of "holds, with less than 1 cm and 20°" to the terms that the program gives
(logistic regression), each object left out in turn, and prints the weights, the area under the ROC curve, how
well the probability is calibrated, and what each term is worth. ``judge`` ranks the 100 survivors of each
object with the fit of all others, tries the ten best, and does the same for the program's own score;
``diversity`` tries the top 20 of the program for several ``--diversity``.

Objects: those of ``../shared`` (``--shared``), metres by the factor listed, masses as weighed for the YCB
objects and plausible for the others, and six of ``semfm-cli demo``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import own_environment

if __name__ == "__main__":
    packages = {"mujoco": "mujoco>=3.3", "scipy": "scipy", "trimesh": "trimesh", "sklearn": "scikit-learn"}
    own_environment.enter("physics", packages)

import physics  # noqa: E402
import numpy as np  # noqa: E402
from sklearn.linear_model import LogisticRegression  # noqa: E402
from sklearn.metrics import roc_auc_score  # noqa: E402

#: Mesh below ``../shared/data`` (or of the demo), metres per unit, kilograms.
OBJECTS = {
    "banana": ("ycb/banana/textured.obj", 1, 0.066),
    "bleach": ("ycb/bleach_cleanser/textured.obj", 1, 1.131),
    "bowl": ("ycb/bowl/textured.obj", 1, 0.147),
    "cracker_box": ("ycb/cracker_box/textured.obj", 1, 0.411),
    "foam_brick": ("ycb/foam_brick/textured.obj", 1, 0.028),
    "hammer": ("ycb/hammer/textured.obj", 1, 0.665),
    "clamp": ("ycb/large_clamp/textured.obj", 1, 0.202),
    "mug": ("ycb/mug/textured.obj", 1, 0.118),
    "mustard": ("ycb/mustard_bottle/textured.obj", 1, 0.603),
    "pitcher": ("ycb/pitcher_base/textured.obj", 1, 0.178),
    "drill": ("ycb/power_drill/textured.obj", 1, 0.895),
    "scissors": ("ycb/scissors/textured.obj", 1, 0.082),
    "spoon": ("ycb/spoon/textured.obj", 1, 0.034),
    "soup_can": ("ycb/tomato_soup_can/textured.obj", 1, 0.349),
    "bm_hammer": ("objects/1_tools_handles/bm_hammer.obj", 1, 0.5),
    "bm_axe": ("objects/1_tools_handles/bm_axe.obj", 1, 0.9),
    "bm_spanner": ("objects/1_tools_handles/bm_spanner.obj", 1, 0.25),
    "bm_mallet": ("objects/1_tools_handles/bm_wooden_mallet.obj", 1, 0.5),
    "wrench": ("objects/1_tools_handles/ycb_adjustable_wrench.obj", 1, 0.252),
    "loafer": ("objects/2_shoes/bm_chunky_loafer.obj", 1, 0.35),
    "slide": ("objects/2_shoes/web_sasitra_slide.obj", 1, 0.15),
    "sneaker": ("objects/2_shoes/web_sneaker_customizer.obj", 1, 0.3),
    "cleaver": ("objects/3_cutting_tools/bm_cleaver.obj", 1, 0.35),
    "kitchen_knife": ("objects/3_cutting_tools/bm_kitchen_knife.obj", 1, 0.15),
    "hacksaw": ("objects/3_cutting_tools/bm_hacksaw_01.obj", 1, 0.35),
    "cdb_knife": ("objects/3_cutting_tools/cdb_knife.obj", 1, 0.08),
    "bm_mug": ("objects/4_water_containers/bm_mug.obj", 1, 0.35),
    "coffee_mug": ("objects/4_water_containers/libero_red_coffee_mug.obj", 1, 0.3),
    "milk_jug": ("objects/4_water_containers/bm_milk_jug.obj", 1, 0.4),
    "teapot": ("objects/4_water_containers/cdb_utah_teapot.obj", 1, 0.5),
    "cup_22": ("objects/4_water_containers/psb_cup_22.obj", 0.07, 0.3),
    "remote": ("objects/5_controllers/ocrtoc_remote_controller_1.obj", 1, 0.1),
    "oculus_go": ("objects/5_controllers/xr_oculus-go_none.obj", 1, 0.1),
    "touch_pro": ("objects/5_controllers/xr_meta-quest-touch-pro_right.obj", 1, 0.15),
    "bm_pliers": ("objects/6_scissor_tools/bm_pliers.obj", 1, 0.2),
    "plier_201": ("objects/6_scissor_tools/psb_plier_201.obj", 0.1, 0.2),
    "cdb_scissors": ("objects/6_scissor_tools/cdb_scissors.obj", 1, 0.08),
}
#: Categories of ``semfm-cli demo``, and the kilograms of the target that it makes.
DEMO = {"tools": 0.4, "shoes": 0.3, "cutting": 0.12, "containers": 0.3, "controllers": 0.2, "scissors": 0.1}
HANDS = ("franka", "robotiq-2f85", "robotiq-2f140")
#: Friction and force of the trials that judge; the mass is the object's own.
USUAL = (0.5, 30.0)
FRICTIONS, FORCES, MASS_FACTORS = (0.3, 0.5, 0.8), (15.0, 30.0, 60.0), (0.5, 1.0, 2.0)
#: Survivors asked for.
POOL = 100


def cases(arguments) -> list[tuple[str, Path, float, float, str]]:
    """Name, mesh, scale, mass and hand: Franka for all, the two Robotiqs in turn."""
    out = []
    things = {name: (arguments.shared / "data" / mesh, s, m) for name, (mesh, s, m) in OBJECTS.items()}
    for name, mass in DEMO.items():
        mesh = arguments.folder / "demo" / name / f"{name}_1_s0.obj"
        if not mesh.exists():
            run(arguments, "demo", "--category", name, "--level", "easy", "-q", "-o", mesh.parent)
        scale = json.loads((mesh.parent / "transfer" / "grasps.json").read_text())["object_scale"]
        things[f"demo_{name}"] = (mesh, scale, mass)
    for i, (name, (mesh, scale, mass)) in enumerate(sorted(things.items())):
        if not mesh.exists():
            raise SystemExit(f"no shared data: expected {mesh} (--shared names the folder)")
        for hand in (HANDS[0], HANDS[1 + i % 2]):
            out.append((name, mesh, scale, mass, hand))
    return out


def run(arguments, *words) -> int:
    words = [arguments.semfm, *map(str, words)]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(words)}: {done.stderr}")
    return done.returncode


def everywhere(mesh: Path, folder: Path) -> Path:
    """A region of all vertices, as the program counts them: OBJ's ``v`` lines."""
    n = sum(line.startswith("v ") for line in mesh.read_text(errors="replace").splitlines())
    path = folder / "regions" / f"{mesh.parent.name}_{mesh.stem}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"vertices": list(range(n))}))
    return path


def grasps_of(arguments, case, *options, tag: str) -> dict | None:
    """The program's answer, kept in FOLDER; None where nothing survived."""
    name, mesh, scale, mass, hand = case
    path = arguments.folder / tag / f"{name}-{hand}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or arguments.again:
        region = everywhere(mesh, arguments.folder)
        words = ["--region", region, "--gripper", hand, "--scale", scale, "--mass", mass]
        words += ["--samples", 70, *options, "-q", "-o", path]
        run(arguments, "grasp", mesh, *words)
    answer = json.loads(path.read_text())
    return answer if answer["grasps"] else None


def tried(arguments, case, answer, which, conditions) -> list[dict]:
    name, mesh, scale, _, _ = case
    key = (mesh, scale)
    if key not in BODIES:
        BODIES[key] = physics.Body.read(mesh, scale, answer["mesh"]["n_triangles"])
    return physics.try_grasps(answer, BODIES[key], answer["mesh"]["hash"], conditions, arguments.cache, which)


BODIES: dict = {}


def random_trials(arguments) -> list[dict]:
    """Trials of random survivors: what ``fit`` learns from."""
    out = []
    for number, case in enumerate(cases(arguments)):
        name, _, _, mass, hand = case
        answer = grasps_of(arguments, case, "--random", "--top", POOL, tag="random")
        if answer is None:
            continue
        rng = np.random.default_rng([number, 3])
        n = len(answer["grasps"])
        # By place, not by rank: another score lists the same grasps in another order.
        order = sorted(range(n), key=lambda i: answer["grasps"][i]["position"])
        which = [order[k] for k in rng.permutation(n)[: arguments.random]]
        others = {}
        for i in which:
            friction, force = rng.choice(FRICTIONS), rng.choice(FORCES)
            others[i] = (float(friction), float(force), float(mass * rng.choice(MASS_FACTORS)), 1)
        trials = tried(arguments, case, answer, which, lambda i: [(*USUAL, mass, 0), others[i]])
        for trial in trials:
            terms = answer["grasps"][trial["grasp"]]["terms"]
            more = {"object": name, "hand": hand, "own_mass": mass, "terms": terms}
            more["said_turn"] = answer["grasps"][trial["grasp"]]["closing_turn"]
            out.append({**trial, **more, "score": answer["grasps"][trial["grasp"]]["score"]})
        strict = np.mean([t["strict"] for t in trials if t["seed"] == 0])
        print(f"{name:14} {hand:14} {n:4} survivors, strict {strict:.2f}", flush=True)
    return out


def adjusted(terms: dict, friction: float, force: float, mass: float, own_mass: float) -> dict:
    """Terms that the program gave for the usual grip, for another friction, force and mass."""
    out = dict(terms)
    more = (friction * force / mass) / (USUAL[0] * USUAL[1] / own_mass)
    for name in ("gravity", "weight"):
        ratio = terms[name] / max(1 - terms[name], 1e-6) * more
        out[name] = ratio / (1 + ratio)
    angle = (1 - terms["friction"]) * np.arctan(USUAL[0])
    out["friction"] = float(np.clip(1 - angle / np.arctan(friction), 0, 1))
    return out


def features(records: list[dict], names: list[str]) -> np.ndarray:
    """(records × names)"""
    keys = ("friction", "force", "mass", "own_mass")
    rows = [adjusted(record["terms"], *(record[key] for key in keys)) for record in records]
    return np.array([[row[name] for name in names] for row in rows])


def model() -> LogisticRegression:
    # Weakly held towards zero: a dozen weights, a thousand trials.
    return LogisticRegression(C=3.0, max_iter=2000)


def left_out(records: list[dict], names: list[str]) -> np.ndarray:
    """For each record the probability by the fit of all other objects."""
    x, y = features(records, names), np.array([r["strict"] for r in records])
    objects = np.array([r["object"] for r in records])
    out = np.zeros(len(records))
    for name in np.unique(objects):
        out[objects == name] = model().fit(x[objects != name], y[objects != name]).predict_proba(x[objects == name])[:, 1]
    return out


#: Terms that the score weighs for physics; the others are preferences of whoever asks.
PHYSICAL = ["contact", "friction", "epsilon", "gravity", "weight", "lever", "evenness", "centred"]


def fit(arguments) -> None:
    records = random_trials(arguments)
    y = np.array([r["strict"] for r in records])
    usual = np.array([r["seed"] == 0 for r in records])
    names = [name for name in PHYSICAL if name in records[0]["terms"]]
    p = left_out(records, names)
    print(f"\n{len(records)} trials, {usual.sum()} at the usual grip, {len({r['object'] for r in records})} objects")
    own = np.array([r["score"] for r in records])
    hands = np.array([r["hand"] for r in records])
    print("\n| hand | trials at the usual grip | held | strict | AUC of the fit, left-out objects | AUC of the score |")
    print("|---|---|---|---|---|---|")
    held = np.array([r["hold"] for r in records])
    for hand in (*HANDS, "all"):
        of = usual & ((hands == hand) | (hand == "all"))
        areas = [roc_auc_score(y[of], said[of]) for said in (p, own)]
        print(f"| {hand} | {of.sum()} | {held[of].mean():.2f} | {y[of].mean():.2f} | {areas[0]:.3f} | {areas[1]:.3f} |")
    print(f"AUC of the fit over all grips, left-out objects: {roc_auc_score(y, p):.3f}")
    chosen = model().fit(features(records, names), y)
    print("\n| term | weight | alone | without it |")
    print("|---|---|---|---|")
    x = features(records, names)
    for k, name in enumerate(names):
        alone = roc_auc_score(y[usual], x[usual, k])
        without = left_out(records, [other for other in names if other != name])
        print(f"| {name} | {chosen.coef_[0][k]:.2f} | {alone:.3f} | {roc_auc_score(y[usual], without[usual]):.3f} |")
    print(f"| (constant) | {chosen.intercept_[0]:.2f} | | |")
    calibration("the fit, left-out objects", p, y)
    calibration("the score, usual grip", own[usual], y[usual])
    turned = np.array([[r["said_turn"], r["closing_turn"]] for r in records if r["seed"] == 0])
    print(f"\nclosing turn, said and in the trial: rank correlation {rank_correlation(*turned.T):.2f}")
    table = [(f"{np.degrees(low):.0f}–{np.degrees(high):.0f}°", turned[(turned[:, 0] >= low) & (turned[:, 0] < high), 1])
             for low, high in zip(TURNS[:-1], TURNS[1:])]
    for label, values in table:
        if len(values):
            print(f"said {label}: {len(values)} trials, median turn {np.degrees(np.median(values)):.1f}°")


def calibration(what: str, said: np.ndarray, strict: np.ndarray) -> None:
    """How often grasps hold of which so much is said."""
    print(f"\n| said by {what} | trials | mean said | held, strict |")
    print("|---|---|---|---|")
    for low, high in ((0, 0.1), (0.1, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1)):
        of = (said >= low) & ((said < high) | (high == 1))
        if of.any():
            print(f"| {low}–{high} | {of.sum()} | {said[of].mean():.2f} | {strict[of].mean():.2f} |")


TURNS = np.radians([0, 0.1, 2, 5, 10, 60])


def rank_correlation(a, b) -> float:
    ranks = [np.argsort(np.argsort(values)) for values in (a, b)]
    return float(np.corrcoef(*ranks)[0, 1])


def judge(arguments) -> None:
    """The ten best of each pool, by the fit of the other objects and by the program's own score."""
    records = random_trials(arguments)
    names = [name for name in PHYSICAL if name in records[0]["terms"]]
    x, y = features(records, names), np.array([r["strict"] for r in records])
    objects = np.array([r["object"] for r in records])
    rows: dict[str, list] = {"refitted": [], "score": []}
    chosen = np.unique(objects)[:: arguments.every]
    for case in cases(arguments):
        name, _, _, mass, hand = case
        if name not in chosen:
            continue
        answer = grasps_of(arguments, case, "--random", "--top", POOL, tag="random")
        if answer is None or len(answer["grasps"]) < 20:
            continue
        trained = model().fit(x[objects != name], y[objects != name])
        terms = np.array([[grasp["terms"][k] for k in names] for grasp in answer["grasps"]])
        ranks = {
            "refitted": np.argsort(-trained.decision_function(terms), kind="stable")[:10],
            "score": np.argsort([-grasp["score"] for grasp in answer["grasps"]], kind="stable")[:10],
        }
        for what, which in ranks.items():
            trials = tried(arguments, case, answer, [int(i) for i in which], lambda _: [(*USUAL, mass, 0)])
            by_grasp = {t["grasp"]: t for t in trials}
            held = [[by_grasp[int(i)][k] for k in ("hold", "strict")] for i in which]
            rows[what].append((name, hand, np.mean(held, axis=0), held[0]))
            print(name, hand, what, *np.round(np.mean(held, axis=0), 2), flush=True)
    print("\n| ranked by | hand | cases | ten best: held | strict | best one: held | strict |")
    print("|---|---|---|---|---|---|---|")
    for what, found in rows.items():
        for hand in (*HANDS, "all"):
            some = [row for row in found if hand in ("all", row[1])]
            ten, best = (np.mean([row[k] for row in some], axis=0) for k in (2, 3))
            print(f"| {what} | {hand} | {len(some)} | {ten[0]:.2f} | {ten[1]:.2f} | {best[0]:.2f} | {best[1]:.2f} |")


def diversity(arguments) -> None:
    """The default answer of the program, for several shares of diversity."""
    some = [case for case in cases(arguments) if case[4] == HANDS[0]][:: arguments.every]
    print("| diversity | cases | best one | ten best | top 20 | mean distance between the top 20 (mm, °) |")
    print("|---|---|---|---|---|---|")
    for share in arguments.shares:
        strict, apart = [], []
        for case in some:
            answer = grasps_of(arguments, case, "--top", 20, "--diversity", share, tag=f"top-{share}")
            if answer is None:
                continue
            which = range(len(answer["grasps"]))
            trials = tried(arguments, case, answer, which, lambda _: [(*USUAL, case[3], 0)])
            held = [t["strict"] for t in trials]
            strict.append((held[0], np.mean(held[:10]), np.mean(held)))
            apart.append(mean_distance(answer["grasps"]))
        means = np.mean(strict, axis=0)
        millimetres, degrees = np.mean(apart, axis=0)
        print(f"| {share} | {len(strict)} | {means[0]:.2f} | {means[1]:.2f} | {means[2]:.2f} | {millimetres:.0f}, {degrees:.0f} |", flush=True)


def mean_distance(grasps: list[dict]) -> tuple[float, float]:
    """Between all pairs: millimetres and degrees, exchanged fingers being the same hand."""
    poses = np.array([grasp["object_from_tcp"] for grasp in grasps])
    places, turns = poses[:, :3, 3], poses[:, :3, :3]
    away = np.linalg.norm(places[:, None] - places, axis=-1)
    cosines = []
    for half_turn in (np.eye(3), np.diag([-1.0, -1.0, 1.0])):
        trace = np.einsum("aij,bij->ab", turns @ half_turn, turns)
        cosines.append((trace - 1) / 2)
    angle = np.degrees(np.arccos(np.clip(np.maximum(*cosines), -1, 1)))
    pairs = np.triu_indices(len(grasps), 1)
    return (1e3 * float(away[pairs].mean()), float(angle[pairs].mean())) if len(grasps) > 1 else (0.0, 0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["collect", "fit", "judge", "diversity"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--shared", type=Path, default=os.environ.get("SEMFM_SHARED", "../shared"))
    parser.add_argument("--semfm", default="semfm-cli")
    parser.add_argument("--random", type=int, default=6, help="random survivors to try, for each object and hand")
    parser.add_argument("--shares", type=float, nargs="+", default=[0.0, 0.05, 0.1, 0.3, 1.0])
    parser.add_argument("--every", type=int, default=1, help="judge and diversity: every how many-th object")
    parser.add_argument("--again", action="store_true", help="ask the program anew (its score has changed)")
    arguments = parser.parse_args()
    arguments.shared = Path(arguments.shared)
    arguments.cache = physics.Cache(arguments.folder / "trials.jsonl")
    {"collect": random_trials, "fit": fit, "judge": judge, "diversity": diversity}[arguments.what](arguments)


if __name__ == "__main__":
    main()
