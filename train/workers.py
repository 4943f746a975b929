"""Several processes that train one net: each on its own batches, gradients averaged at every step.

    torchrun --nproc-per-node 2 -m train.train …

Two processes of one thread waste less on a busy machine than one process of two threads, whose
threads wait for each other after every convolution.
"""

from __future__ import annotations

import os
from collections.abc import Iterable

import torch
from torch import distributed


def start() -> None:
    """Joins the other processes, where torchrun started this one."""
    if "RANK" in os.environ:
        distributed.init_process_group("gloo")


def rank() -> int:
    """Number of this process, from 0."""
    return distributed.get_rank() if distributed.is_initialized() else 0


def count() -> int:
    """Number of processes."""
    return distributed.get_world_size() if distributed.is_initialized() else 1


def mine(items: list) -> list:
    """This process's share of a list: every item belongs to one process."""
    return items[rank() :: count()]


def largest(value: float) -> float:
    """The largest of a number over all processes, so that they decide alike."""
    if count() == 1:
        return value
    found = torch.tensor([value], dtype=torch.float64)
    distributed.all_reduce(found, distributed.ReduceOp.MAX)
    return found.item()


def average_gradients(parameters: Iterable[torch.nn.Parameter]) -> None:
    """Replaces each gradient by its mean over all processes."""
    if count() == 1:
        return
    gradients = [p.grad for p in parameters if p.grad is not None]
    flat = torch.cat([gradient.flatten() for gradient in gradients])
    distributed.all_reduce(flat)
    flat /= count()
    at = 0
    for gradient in gradients:
        gradient.copy_(flat[at : at + gradient.numel()].view_as(gradient))
        at += gradient.numel()
