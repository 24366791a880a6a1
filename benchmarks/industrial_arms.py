"""Arms of makers' packages without masses: how many plan a line within limits of velocity and acceleration.

Usage: python benchmarks/industrial_arms.py [--count N] [--only NAME]

``industrial_arms.csv`` has the kinematic figures alone, a row for each joint: origins in m and rad, axes, ranges and
speeds in rad, m and s, and what a joint beside the chain follows. Sources: the URDFs of the packages abb,
abb_experimental, fanuc, fanuc_experimental, kuka_experimental, motoman, staubli and staubli_experimental of
ROS-Industrial; the DH parameters that Universal Robots publishes (ur5, ur10); the data sheet of the Adept Cobra s600
(cobra_s600); and round figures of our own for two paint wrists (three_roll_wrist, three_roll_offset).

Every arm becomes a URDF without masses and with efforts of 0. `brachis.apps.starter` finds a posture and a line, which
is planned again with 8 rad/s^2 or m/s^2 for every joint. An arm of which a joint on the chain follows another is
refused; that is right, and counted apart.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import yaml

import brachis
from brachis.apps.starter import starter_task

TABLE = Path(__file__).with_suffix(".csv")
Row = Mapping[str, str]


def arms() -> dict[str, list[Row]]:
    """Return the rows of each arm by maker and name."""
    with TABLE.open() as stream:
        rows = list(csv.DictReader(stream))
    grouped = groupby(rows, itemgetter("maker", "arm"))
    return {" ".join(key): list(joints) for key, joints in grouped}


def write_urdf(rows: Iterable[Row]) -> str:
    """Write a URDF without masses; the link that a joint moves has the joint's name, the tool's link is ``tool``."""
    rows = list(rows)
    chain = [row["joint"] for row in rows if not row["follows"]]
    links = {"": "base", **{row["joint"]: f"link_{row['joint']}" for row in rows}}
    links[chain[-1]] = "tool"
    parts = [f'<link name="{link}"/>' for link in links.values()]
    for row in rows:
        axis = f'<axis xyz="{row["axis"]}"/>' if row["axis"] else ""
        ends = f'lower="{row["lower"]}" upper="{row["upper"]}"' if row["lower"] else ""
        limit = f'<limit effort="0" velocity="{row["velocity"] or 1}" {ends}/>'
        follows = f'<mimic joint="{row["follows"]}" multiplier="{row["factor"]}"/>'
        parts.append(
            f'<joint name="{row["joint"]}" type="{row["type"]}">'
            f'<parent link="{links[row["above"]]}"/><child link="{links[row["joint"]]}"/>'
            f'<origin xyz="{row["xyz_m"]}" rpy="{row["rpy_rad"]}"/>{axis}'
            f"{limit if axis else ''}{follows if row['follows'] else ''}</joint>"
        )
    return f'<robot name="{rows[0]["arm"]}">{"".join(parts)}</robot>'


def follows_on_the_chain(rows: Iterable[Row]) -> bool:
    """Tell whether a joint on the way to the tool follows another one."""
    rows = list(rows)
    above = {row["joint"]: row["above"] for row in rows}
    joint = next(row["joint"] for row in reversed(rows) if row["type"] == "fixed")
    followers = {row["joint"] for row in rows if row["follows"]}
    while joint:
        if joint in followers:
            return True
        joint = above[joint]
    return False


def plan_line(rows: Iterable[Row], folder: Path) -> brachis.Result:
    """Plan the line that `brachis new` finds, with 8 rad/s^2 or m/s^2."""
    urdf = folder / "arm.urdf"
    urdf.write_text(write_urdf(rows))
    task = yaml.safe_load(starter_task(urdf, folder=folder, tool_frame="tool").text)
    task["robot"] |= {"urdf": str(urdf), "limits": {"acceleration": 8.0}}
    return brachis.plan(task)


def main() -> None:
    """Print a row for each arm, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, help="plan this many, spread over all")
    parser.add_argument("--only", default="", help="arms whose name contains this")
    asked = parser.parse_args()
    table = {name: rows for name, rows in arms().items() if asked.only in name}
    names = list(table)
    if asked.count:
        names = names[:: max(len(names) // asked.count, 1)][: asked.count]
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            began = time.perf_counter()
            try:
                result = plan_line(table[name], Path(folder))
            except brachis.BrachisError as error:
                is_right = follows_on_the_chain(table[name])
                verdict = "refused, rightly" if is_right else "FAILED"
                text = str(error)[:300]
            else:
                verdict = "verified" if result.verified else "NOT VERIFIED"
                text = (
                    f"{result.t_end:.4f} s, {len(result.trajectory.joint_names)} joints"
                )
            counts[verdict] += 1
            seconds = time.perf_counter() - began
            print(f"{name:40} {verdict:17} {seconds:5.1f} s  {text}", flush=True)
    total = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    print(f"{len(names)} arms without masses: {total}")


if __name__ == "__main__":
    main()
