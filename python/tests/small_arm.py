"""A small arm with a hand, written for tests."""

from __future__ import annotations

from pathlib import Path

LINK = '<link name="{}"/>'
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}</joint>"""
LIMIT = '<limit lower="{}" upper="{}" velocity="2" effort="10"/>'

SRDF = """<robot name="small"><group name="arm"><chain base_link="base" tip_link="flange"/></group>
<group_state name="ready" group="arm">{}</group_state>
<disable_collisions link1="base" link2="l1" reason="Adjacent"/></robot>"""
LIMITS = "joint_limits:\n  j1:\n    max_velocity: 1.5\n    max_acceleration: [4.0]\n"


def write_arm(folder: Path) -> Path:
    """Six joints that turn, a flange, a finger that slides; an SRDF and limits beside them."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0")
    heights = (0.2, 0.1, 0.4, 0.3, 0.1, 0.1)
    links, joints, parent = ["base"], [], "base"
    for i, (axis, height) in enumerate(zip(axes, heights), start=1):
        limit = LIMIT.format(-2.9, 2.9)
        joints.append(
            JOINT.format(
                name=f"j{i}", kind="revolute", parent=parent, child=f"l{i}", xyz=f"0 0.05 {height}",
                rpy="0 0 0.1", axis=axis, limit=limit,
            )
        )  # fmt: skip
        parent = f"l{i}"
        links.append(parent)
    links += ["flange", "finger"]
    joints += [
        JOINT.format(
            name="end", kind="fixed", parent="l6", child="flange", xyz="0 0 0.1", rpy="0 0 0",
            axis="0 0 1", limit="",
        ),
        JOINT.format(
            name="slide", kind="prismatic", parent="flange", child="finger", xyz="0 0 0.05",
            rpy="0 0 0", axis="0 1 0", limit=LIMIT.format(0, 0.04),
        ),
    ]  # fmt: skip
    path = folder / "small.urdf"
    parts = [LINK.format(link) for link in links] + joints
    path.write_text(f'<robot name="small">{"".join(parts)}</robot>')
    state = "".join(f'<joint name="j{i}" value="{0.1 * i}"/>' for i in range(1, 7))
    path.with_suffix(".srdf").write_text(SRDF.format(state))
    path.with_name("joint_limits.yaml").write_text(LIMITS)
    return path
