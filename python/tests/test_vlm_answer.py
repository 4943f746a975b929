"""Replies: the form asked for is read, everything else is a failure of one of the kinds."""

from __future__ import annotations

import json

import numpy as np
import pytest
from semfm.vlm import read_object, read_region
from semfm.vlm.answer import UnusableAnswer, read_answer
from semfm.vlm.endpoint import Reply
from semfm.vlm.lifting import region_mask
from semfm.vlm.question import Drawing, ask_for_region
from semfm.vlm.segments import segment
from semfm.vlm.true_masks import true_answer

SQUARE = [[250, 250], [750, 250], [750, 750], [250, 750]]


def reply(text: str, finish_reason: str = "stop", refusal: str | None = None) -> Reply:
    return Reply(text, refusal, finish_reason, "simulated/test", 1, 1, 1.0, 0.0, 1)


@pytest.fixture(scope="module", params=["polygons", "marks"])
def question(request, mallets):
    source, target = (read_object(mallets[name].views) for name in ("short", "long"))
    weights = read_region(mallets["short"].region, source)
    views = target.views[:2]
    cut = segment(target, views, 12) if request.param == "marks" else None
    masks = [region_mask(view, weights) for view in source.views[:1]]
    return ask_for_region(source.views[:1], masks, views, cut, Drawing(128))


def views(question, first, second) -> str:
    return json.dumps(
        {
            "views": [
                {"view": "T2", question.mode: second},
                {"view": "T1", question.mode: first},
            ]
        }
    )


def fails(question, text: str, kind: str, **kwargs) -> str:
    with pytest.raises(UnusableAnswer) as error:
        read_answer(reply(text, **kwargs), question)
    assert error.value.kind == kind, error.value
    return error.value.reason


def test_an_answer_becomes_masks(question):
    if question.mode == "polygons":
        masks = read_answer(reply(views(question, [SQUARE], [])), question)
        height, width = masks[0].shape
        expected = np.zeros((height, width), bool)
        expected[height // 4 : 3 * height // 4, width // 4 : 3 * width // 4] = True
    else:
        chosen = np.unique(question.segments[0])[1:3].tolist()
        masks = read_answer(reply(views(question, chosen, [])), question)
        expected = np.isin(question.segments[0], chosen)
    np.testing.assert_array_equal(masks[0], expected)
    assert not masks[1].any()


def test_a_code_fence_is_taken_off(question, mallets):
    weights = read_region(mallets["long"].region, read_object(mallets["long"].views))
    text = true_answer(question, weights)
    plain = read_answer(reply(text), question)
    for fenced in (f"```json\n{text}\n```", f"\n```\n{text}\n``` \n"):
        for a, b in zip(plain, read_answer(reply(fenced), question)):
            np.testing.assert_array_equal(a, b)
    fails(question, f"Sure:\n```json\n{text}\n```", "prose")


def test_true_answers_are_the_masks_or_the_patches_mostly_in_them(question, mallets):
    weights = read_region(mallets["long"].region, read_object(mallets["long"].views))
    masks = read_answer(reply(true_answer(question, weights)), question)
    for i, (mask, view) in enumerate(zip(masks, question.views)):
        truth = region_mask(view, weights)
        if question.segments is None:
            np.testing.assert_array_equal(mask, truth)
        else:
            for number in np.unique(question.segments[i])[1:]:
                patch = question.segments[i] == number
                assert mask[patch].all() == (truth[patch].mean() > 0.5)
                assert mask[patch].any() == mask[patch].all()


def test_what_is_no_answer_says_why(question):
    m = question.mode
    good = [SQUARE] if m == "polygons" else [int(question.segments[0].max())]
    fails(question, "", "refusal", refusal="I can't help with that.")
    fails(question, "", "refusal", finish_reason="content_filter")
    fails(question, views(question, good, [])[:-9], "truncated", finish_reason="length")
    for prose in ("", "I'm sorry, I can't help with that.", "The handle is at the bottom."):
        fails(question, prose, "prose")
    for broken in (views(question, good, [])[:-2], '{"views": [NaN]}', "{'views': []}", "[" * 9999):
        fails(question, broken, "json")
    for other in ("[]", "{}", '{"views": {}}', '{"views": [3]}', '{"views": [{"view": "T1"}]}'):
        fails(question, other, "schema")
    one = {"view": "T1", m: good}
    assert "no answer for T2" in fails(question, json.dumps({"views": [one]}), "schema")
    assert "twice" in fails(question, json.dumps({"views": [one, one]}), "schema")
    for name in ("T9", 1, None, ["T1"]):
        text = json.dumps({"views": [{**one, "view": name}]})
        assert "expected a view" in fails(question, text, "schema")
    fails(question, views(question, [], []), "empty")


POLYGON_FAULTS = [
    ([[[0, 0], [9, 9]]], "schema"),
    ([[0, 0], [9, 9], [0, 9]], "schema"),
    ([[[0, 0], [9, 9], [0, "9"]]], "schema"),
    ([[[0, 0], [9, 9], [0, 9, 1]]], "schema"),
    ([[[0, 0], [9, 9], [0, True]]], "schema"),
    ([[[0, 0], [9, 9], [0, 1e999]]], "json"),
    ([[[0, 0], [1000.5, 9], [0, 9]]], "polygon"),
    ([[[0, 0], [9, -1], [0, 9]]], "polygon"),
    ([[[0, 0], [900, 900], [900, 0], [0, 900]]], "polygon"),
    ([[[0, 0], [1, 0], [0, 1]]], "empty"),
]
MARK_FAULTS = [
    (["3"], "schema"),
    ([1.0], "schema"),
    ([True], "schema"),
    ([0], "marks"),
    ([99], "marks"),
]


def test_faulty_regions_say_where(question):
    for given, kind in POLYGON_FAULTS if question.mode == "polygons" else MARK_FAULTS:
        reason = fails(question, views(question, given, []), kind)
        assert kind in ("json", "empty") or reason.startswith("T1: "), reason
