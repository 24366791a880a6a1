"""The chain of a URDF that is meant where nothing is said: an arm, without its fingers and without the trunk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from brachis.errors import UrdfError
from brachis.robot.urdf import MOVING_TYPES, joints_between, parse_urdf


@dataclass(frozen=True)
class Limb:
    """What of a robot is taken where nothing is said.

    Attributes
    ----------
    base : str or None
        The link from which several limbs part; None where there is one, which begins at the URDF's root.
    tool : str
        The last link before the limb itself parts, into fingers for example; of a single chain its end.
    leaves : tuple of str
        Links at the limb's ends.
    """

    base: str | None
    tool: str
    leaves: tuple[str, ...]


def first_limb(text: str, where: str) -> Limb:
    """Find the chain of most joints in a URDF: an arm without its fingers, and without the trunk that it shares.

    Limbs share less than half of their joints. Of several the first one in the file is taken.

    Raises
    ------
    UrdfError
        The text is broken, or no joint moves anything.
    """
    tree, urdf = parse_urdf(text, where)
    parents = {joint.child: joint for joint in urdf.robot.joints}
    inner = {joint.parent for joint in urdf.robot.joints}
    leaves = tuple(name for name in tree.links if name not in inner)
    chains = {leaf: joints_between(tree.root, leaf, parents, where) for leaf in leaves}
    most = max(_moving(chain) for chain in chains.values())
    if not most:
        raise UrdfError(
            "no joint moves", where=where, found=f"chains to {', '.join(leaves)}"
        )
    longest = [chain for chain in chains.values() if _moving(chain) == most]
    first = longest[0]
    limb = {leaf: chain for leaf, chain in chains.items() if _is_of(first, chain)}
    trunk = _shared(*longest)
    base = trunk[-1].child if trunk and 2 * _moving(trunk) < most else None
    return Limb(base, _shared(*limb.values())[-1].child, tuple(limb))


def _is_of(limb: Sequence[Any], chain: Sequence[Any]) -> bool:
    """Tell whether a chain parts from a limb in its upper half, and moves there; frames half way up are no fingers."""
    shared, joints = _moving(_shared(limb, chain)), _moving(limb)
    return 2 * shared >= joints and (_moving(chain) > shared or shared == joints)


def _moving(chain: Sequence[Any]) -> int:
    """Count the joints that move."""
    return sum(joint.type in MOVING_TYPES for joint in chain)


def _shared(*chains: Sequence[Any]) -> list[Any]:
    """Joints with which chains from the same root begin, before they part."""
    shared = []
    for step in zip(*chains, strict=False):
        if len({joint.child for joint in step}) > 1:
            break
        shared.append(step[0])
    return shared
