"""One pair: views of both objects, one question, and the answer lifted and fused."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..sidecar.errors import expected
from .answer import UnusableAnswer, read_answer
from .choose_views import choose_views
from .client import EndpointError
from .endpoint import SIMULATED, Endpoint, Reply
from .lifting import Lifted, counted, lift, region_mask
from .object_views import ObjectView, ObjectViews
from .question import MODES, Drawing, Question, ask_for_region, prompts_hash
from .region import COUNTS, region_entries
from .segments import segment


@dataclass(frozen=True)
class BaselineSettings:
    """How a pair is asked about and its answer used.

    Attributes
    ----------
    mode
        One of :data:`.question.MODES`.
    threshold
        Share of the views that see a vertex which must mark it, above 0 and at most 1.
    n_segments
        Patches that the target's surface is cut into, with ``marks``.
    drawing
        Of the pictures.
    hint
        What the region is for, in words; may be empty.
    """

    mode: str = "polygons"
    threshold: float = 0.5
    n_segments: int = 64
    drawing: Drawing = field(default_factory=Drawing)
    hint: str = ""

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise expected("settings", "mode", " or ".join(MODES), repr(self.mode))
        if not 0 < self.threshold <= 1:
            raise expected("settings", "threshold", "above 0 and at most 1", self.threshold)
        if not 1 <= self.n_segments <= 500:
            raise expected("settings", "marks", "1 to 500", self.n_segments)
        if not 64 <= self.drawing.side <= 4096:
            raise expected("settings", "picture side", "64 to 4096 pixels", self.drawing.side)

    def describe(self) -> dict[str, Any]:
        """Everything here that changes a result, and the hash of the prompts."""
        return {**asdict(self), "prompts": prompts_hash()}


@dataclass(frozen=True)
class Failure:
    """Why a pair has no region.

    Attributes
    ----------
    kind
        One of :data:`.answer.KINDS`, or of :class:`.endpoint.EndpointError`'s.
    reason
        In words.
    text
        The model's reply, or the endpoint's, as it came.
    of_endpoint
        Whether there was no reply at all, so that asking again may help.
    """

    kind: str
    reason: str
    text: str
    of_endpoint: bool


@dataclass(frozen=True)
class Outcome:
    """What became of one pair.

    Attributes
    ----------
    question
        As asked.
    source_views, target_views
        Numbers of the views in their files.
    weights
        (n) of the target's vertices, one half or more counting; None for a failure.
    masks
        (height × width) bool per target view: what the answer marks; None for a failure.
    lifted
        Votes behind the weights; None for a failure.
    failure
        None for a region.
    reply
        The model's; None where the endpoint failed.
    stages_ms
        ``choose`` (views), ``draw`` (pictures), ``model`` (the request that was answered),
        ``wait`` (failed attempts and pauses before it) and ``lift``.
    """

    question: Question
    source_views: list[str]
    target_views: list[str]
    weights: np.ndarray | None
    masks: list[np.ndarray] | None
    lifted: Lifted | None
    failure: Failure | None
    reply: Reply | None
    stages_ms: dict[str, float]

    @property
    def real_model(self) -> bool:
        """Whether a model was asked, by the name that the endpoint gave it."""
        return self.reply is not None and not self.reply.model.startswith(SIMULATED)


def transfer(
    source: ObjectViews,
    target: ObjectViews,
    region: np.ndarray,
    n_views: int,
    endpoint: Endpoint,
    settings: BaselineSettings = BaselineSettings(),
) -> Outcome:
    """Transfer a region from source to target by asking a model.

    Parameters
    ----------
    source, target
        The objects.
    region
        (n_source) weights in [0, 1], one half or more counting.
    n_views
        Of each object, shown in one question.
    endpoint
        Who is asked.
    settings
        How.

    Returns
    -------
    Outcome
        With a region or a failure: whatever the model or endpoint does is an outcome.

    Raises
    ------
    SidecarError
        If there are fewer views, or no view shows the region.
    """
    clock = _Clock()
    source_views, source_masks, target_views = _views(source, target, region, n_views)
    clock.stage("choose")
    cut = None
    if settings.mode == "marks":
        cut = segment(target, target_views, settings.n_segments)
    question = ask_for_region(
        source_views, source_masks, target_views, cut, settings.drawing, settings.hint
    )
    clock.stage("draw")
    reply: Reply | None = None
    weights = masks = lifted = failure = None
    try:
        reply = endpoint.ask(question)
        clock.took(model=reply.model_ms, wait=reply.waited_ms)
        masks = read_answer(reply, question)
        lifted = lift(target, target_views, masks)
        weights = counted(lifted.votes, settings.threshold)
        if not (weights >= COUNTS).any():
            reason = f"no vertex is marked by {settings.threshold:.0%} of the views that see it"
            raise UnusableAnswer("empty", reason)
        clock.stage("lift")
    except EndpointError as error:
        clock.stage("wait")
        failure = Failure(error.kind, "the endpoint gave no reply", error.text, True)
    except UnusableAnswer as error:
        assert reply is not None, "only a reply can be unusable"
        weights = masks = lifted = None
        failure = Failure(error.kind, error.reason, reply.refusal or reply.text, False)
    shown = [[view.name for view in views] for views in (source_views, target_views)]
    return Outcome(
        question, shown[0], shown[1], weights, masks, lifted, failure, reply, clock.stages_ms
    )


def _views(
    source: ObjectViews, target: ObjectViews, region: np.ndarray, n_views: int
) -> tuple[list[ObjectView], list[np.ndarray], list[ObjectView]]:
    """Views of the source from the one that shows most of the region, with the region's masks,
    and of the target from the one that shows most of the object."""
    shown = [region_mask(view, region) for view in source.views]
    interest = np.array([mask.sum() for mask in shown])
    if not interest.any():
        raise expected(source.path, "views", "one that shows the region", "none")
    chosen = choose_views(source, n_views, interest)
    seen = np.array([view.on_object.sum() for view in target.views])
    of_target = [target.views[i] for i in choose_views(target, n_views, seen)]
    return [source.views[i] for i in chosen], [shown[i] for i in chosen], of_target


class _Clock:
    def __init__(self) -> None:
        self.stages_ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def stage(self, name: str) -> None:
        """Book the time since the last booking."""
        now = time.perf_counter()
        self.took(**{name: 1000 * (now - self._last)})

    def took(self, **stages_ms: float) -> None:
        """Book times that were measured elsewhere; the clock goes on from here."""
        for name, ms in stages_ms.items():
            self.stages_ms[name] = round(ms, 3)
        self._last = time.perf_counter()


def outcome_row(
    outcome: Outcome, target: ObjectViews, settings: BaselineSettings
) -> dict[str, Any]:
    """An outcome as the columns of a row (see :mod:`.rows`) that do not name the pair."""
    reply, failure = outcome.reply, outcome.failure
    region = None if outcome.weights is None else region_entries(outcome.weights)
    inconsistency = outcome.lifted.inconsistency if outcome.lifted else None
    return {
        "mode": settings.mode,
        "model": reply.model if reply else None,
        "real_model": outcome.real_model,
        "mesh": target.identity,
        "views": {"source": outcome.source_views, "target": outcome.target_views},
        "region": region,
        "inconsistency": None if inconsistency is None else round(inconsistency, 6),
        "failure": None if failure is None else _describe(failure),
        "stages_ms": outcome.stages_ms,
        "tokens": _tokens(reply),
        "attempts": reply.attempts if reply else None,
        "cached": reply.cached if reply else False,
    }


def _describe(failure: Failure) -> dict[str, Any]:
    values = asdict(failure)
    return {"kind": values.pop("kind"), "text": values.pop("text"), **values}


def _tokens(reply: Reply | None) -> dict[str, int] | None:
    if reply is None or reply.prompt_tokens is None or reply.completion_tokens is None:
        return None
    return {"prompt": reply.prompt_tokens, "completion": reply.completion_tokens}


def total_tokens(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """Tokens summed over rows; those of kept replies apart, since they were not paid again."""
    sums = {"prompt": 0, "completion": 0, "kept": 0}
    for row in rows:
        tokens = row["tokens"] or {"prompt": 0, "completion": 0}
        if row["cached"]:
            sums["kept"] += tokens["prompt"] + tokens["completion"]
        else:
            sums["prompt"] += tokens["prompt"]
            sums["completion"] += tokens["completion"]
    return sums
