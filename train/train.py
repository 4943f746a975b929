"""Trains the student on the fused fields of a folder of objects.

    python -m train.train DATA -o stage1.pt --pictures 200000
    python -m train.train DATA -o stage2.pt --from stage1.pt --pictures 100000 --decay 1

The rate warms up, stays, and falls to zero over the last `--decay` share of the pictures; a piece
with `--decay 0` can be gone on from at any time. Every piece writes its checkpoint as it goes, and
objects that have been added to the folder since are taken up at each report. See `workers.py` for
training with several processes. `--from FILE.net` starts from exported weights: those before the
head are kept, the head is learnt anew, since the axes that it answered on are not in the file.

Loss, over patches with weight w, target t (length 1 on average) and token z:

    Σ w |z − t|² / Σ w  +  Σ w (1 − cos(z, t)) / Σ w
"""

from __future__ import annotations

import argparse
import copy
import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from . import workers
from .augment import as_input, augmented
from .checkpoint import Checkpoint
from .examples import Batch, Examples, fit_axes
from .export import read_net
from .net import Student, student_of, without_norms

#: Tried: .02. Larger slows learning down, smaller was not told apart.
_WEIGHT_DECAY = 0.02
#: The exported weights are a running mean over about so many steps, fewer at the start.
_MEAN_STEPS = 400
_WARM_UP_STEPS = 200
_CLIP_NORM = 5.0


@dataclass(frozen=True)
class Settings:
    """One piece of training."""

    pictures: int
    decay: float = 0.3
    rate: float = 2e-3
    batch: int = 64
    seed: int = 0
    minutes: float = math.inf

    @property
    def steps(self) -> int:
        return max(1, self.pictures // (self.batch * workers.count()))

    def progress(self, step: int, minutes: float) -> float:
        """How much of the piece is over, 0 to 1: by the count, or by the clock where one is set."""
        return max(step / self.steps, minutes / self.minutes)

    def rate_at(self, step: int, progress: float) -> float:
        """Warm-up, plateau, linear fall to zero."""
        left = (1 - progress) / max(self.decay, 1e-9)
        return self.rate * max(0, min(1, (step + 1) / _WARM_UP_STEPS, left))


@dataclass(frozen=True)
class Fit:
    """How near tokens are to targets: mean squared distance and mean cosine."""

    squared: torch.Tensor
    cosine: torch.Tensor

    @property
    def loss(self) -> torch.Tensor:
        return self.squared + (1 - self.cosine)


def fit(tokens: torch.Tensor, targets: torch.Tensor, weights: torch.Tensor) -> Fit:
    """Of tokens (n, 64, 14, 14), targets (n, 14, 14, 64) and weights (n, 14, 14)."""
    tokens = tokens.float().permute(0, 2, 3, 1)
    targets, weights = targets.float(), weights.float() / 255
    total = weights.sum().clamp(min=1)
    squared = (weights * ((tokens - targets) ** 2).sum(-1)).sum() / total
    cosine = (weights * functional.cosine_similarity(tokens, targets, dim=-1)).sum() / total
    return Fit(squared, cosine)


class Trainer:
    """A student, its running mean and its optimiser."""

    def __init__(
        self,
        settings: Settings,
        start: Checkpoint | None = None,
        merge_norms: bool = False,
        trunk: Student | None = None,
    ) -> None:
        torch.manual_seed(settings.seed)
        self.settings = settings
        if start is not None:
            student = start.student_in_training()
        else:
            student = trunk if trunk is not None else Student()
        mean = start.student() if start is not None else copy.deepcopy(student)
        merged = merge_norms and student.normed
        if merged:
            student = without_norms(mean)
            mean = copy.deepcopy(student)
        self.student = student.to(memory_format=torch.channels_last)
        self.mean = mean.to(memory_format=torch.channels_last)
        plain = [p for p in self.student.parameters() if p.ndim <= 1]
        matrices = [p for p in self.student.parameters() if p.ndim > 1]
        groups = [
            {"params": matrices, "weight_decay": _WEIGHT_DECAY},
            {"params": plain, "weight_decay": 0.0},
        ]
        self.optimiser = torch.optim.AdamW(groups, lr=settings.rate)
        if start is not None and not merged:
            self.optimiser.load_state_dict(start.optimiser)
        self.step_of_piece = 0
        pictures = start.provenance["pictures"] if start is not None else 0
        self.steps_before = pictures // (settings.batch * workers.count())
        self._started = time.monotonic()

    def progress(self) -> float:
        """How much of the piece is over, the same in all processes."""
        minutes = (time.monotonic() - self._started) / 60
        return workers.largest(self.settings.progress(self.step_of_piece, minutes))

    def step(self, batch: Batch) -> Fit:
        """One step on a batch of inputs (see `augment.py`)."""
        rate = self.settings.rate_at(self.step_of_piece, self.progress())
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.student.train()
        inputs = batch.pictures.contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16):
            tokens = self.student(inputs)
        found = fit(tokens, batch.targets, batch.weights)
        self.optimiser.zero_grad(set_to_none=True)
        found.loss.backward()
        workers.average_gradients(self.student.parameters())
        torch.nn.utils.clip_grad_norm_(self.student.parameters(), _CLIP_NORM)
        self.optimiser.step()
        self.step_of_piece += 1
        self._update_mean()
        return found

    def _update_mean(self) -> None:
        """mean ← mean + (weights − mean) / n for n = min(1 + steps / 10, _MEAN_STEPS)."""
        steps = self.steps_before + self.step_of_piece
        share = 1 / min(1 + steps / 10, _MEAN_STEPS)
        with torch.no_grad():
            state = self.student.state_dict()
            for name, tensor in self.mean.state_dict().items():
                if tensor.is_floating_point():
                    tensor.lerp_(state[name], share)
                else:
                    tensor.copy_(state[name])

    def validate(self, examples: Examples, limit: int = 384) -> Fit:
        """Of the running mean, on pictures as they are."""
        pairs = examples.shuffled(np.random.default_rng(0))[:limit]
        self.mean.eval()
        found = []
        with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
            for start in range(0, len(pairs), 64):
                batch = examples.batch(pairs[start : start + 64])
                inputs = as_input(batch.pictures).contiguous(memory_format=torch.channels_last)
                found.append(fit(self.mean(inputs), batch.targets, batch.weights))
        return Fit(
            torch.stack([f.squared for f in found]).mean(),
            torch.stack([f.cosine for f in found]).mean(),
        )


def batches(examples: Examples, settings: Settings, seed: int):
    """Augmented batches without end, every picture once a pass; new objects join the next pass."""
    rng = np.random.default_rng(seed)
    generator = torch.Generator().manual_seed(seed)
    while True:
        order = examples.shuffled(rng)
        n_objects = len(examples.pictures)
        for start in range(0, max(1, len(order) - settings.batch + 1), settings.batch):
            yield augmented(examples.batch(order[start : start + settings.batch]), generator)
            if len(examples.pictures) > 1.1 * n_objects:
                break


def cpu_minutes() -> float:
    """CPU time of all processes of this piece, as if they were alike."""
    return time.process_time() * workers.count() / 60


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of train.dataset")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CHECKPOINT")
    parser.add_argument("--from", dest="start", type=Path, metavar="CHECKPOINT|FILE.net")
    parser.add_argument("--pictures", type=int, required=True, help="passes through the net")
    parser.add_argument(
        "--minutes", type=float, default=math.inf, help="end by the clock where that is earlier"
    )
    parser.add_argument("--decay", type=float, default=0.3)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument(
        "--merge-norms", action="store_true", help="go on from the running mean without batch norms"
    )
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--load", type=int, help="objects that are read at once: start sooner")
    parser.add_argument("--report", type=int, default=150, help="steps between reports")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    workers.start()
    start, trunk, before = None, None, {"pictures": 0, "cpu_minutes": 0.0, "pieces": []}
    if arguments.start and arguments.start.suffix == ".net":
        description, layers = read_net(arguments.start.read_bytes())
        trunk, before = student_of(layers), description["provenance"]
        trunk.head.reset_parameters()
    elif arguments.start:
        start = Checkpoint.read(arguments.start)
        before = start.provenance
    axes = start.axes if start else fit_axes(arguments.data, "train_*.npz")
    seen, left_out = Examples.empty(), Examples.empty()
    settings = Settings(
        arguments.pictures,
        arguments.decay,
        arguments.rate,
        arguments.batch,
        arguments.seed,
        arguments.minutes,
    )
    trainer = Trainer(settings, start, arguments.merge_norms, trunk)

    def load_new() -> None:
        seen.load_new(
            workers.mine(sorted(arguments.data.glob("train_*.npz"))), axes, arguments.load
        )
        if workers.rank() == 0:
            left_out.load_new(sorted(arguments.data.glob("left_*.npz"))[:32], axes)

    def n_objects() -> int:
        return len(list(arguments.data.glob("train_*.npz")))

    def checkpoint() -> Checkpoint:
        piece = {
            "seed": settings.seed,
            "pictures": trainer.step_of_piece * settings.batch * workers.count(),
            "rate": settings.rate,
            "decay": settings.decay,
            "norms": trainer.student.normed,
            "batch": settings.batch * workers.count(),
            "objects": n_objects(),
        }
        provenance = {
            "objects": n_objects(),
            "pictures": before["pictures"] + piece["pictures"],
            "cpu_minutes": round(before["cpu_minutes"] + cpu_minutes(), 1),
            "variance_kept": round(axes.kept, 4),
            "pieces": [*before["pieces"], piece],
        }
        return Checkpoint(
            trainer.student.state_dict(),
            trainer.mean.state_dict(),
            trainer.optimiser.state_dict(),
            axes,
            provenance,
        )

    load_new()
    if workers.rank() == 0:
        print(
            f"{len(seen.pictures)} objects a process, {len(left_out.pictures)} left out, "
            f"{axes.kept:.3f} of the variance on the axes",
            flush=True,
        )
    recent = []
    seed = (settings.seed + before["pictures"]) * workers.count() + workers.rank()
    source = batches(seen, settings, seed)
    over = False
    while not over:
        found = trainer.step(next(source))
        recent.append((found.squared.item(), found.cosine.item()))
        over = trainer.progress() >= 1
        if trainer.step_of_piece % arguments.report and not over:
            continue
        if workers.rank() == 0:
            squared, cosine = np.mean(recent, axis=0)
            kept_back = trainer.validate(left_out)
            print(
                f"step {trainer.step_of_piece} of {settings.steps}: squared {squared:.3f}, cosine "
                f"{cosine:.3f}; left out: squared {kept_back.squared:.3f}, cosine "
                f"{kept_back.cosine:.3f}; {len(seen.pictures) * workers.count()} objects, "
                f"{cpu_minutes():.1f} CPU min",
                flush=True,
            )
            checkpoint().write(arguments.output)
        recent.clear()
        load_new()


if __name__ == "__main__":
    main()
