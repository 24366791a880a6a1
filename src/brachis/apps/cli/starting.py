"""``brachis new | robots``: what a new user begins with."""

from __future__ import annotations

from pathlib import Path

from brachis import robots
from brachis.apps.cli.folder import write_text
from brachis.apps.cli.output import (
    Column,
    print_json,
    print_table,
    progress,
    result_console,
    shown_warnings,
)
from brachis.apps.cli.settings import urdf_of
from brachis.apps.starter import starter_task
from brachis.common.files import status_of, writing_errors
from brachis.errors import InputError


def new_command(
    urdf: Path,
    out: Path,
    *,
    tool_frame: str | None,
    base_frame: str | None,
    as_json: bool,
) -> None:
    """Write a first task, which was planned and verified, and say what is next."""
    with writing_errors(out):
        exists = status_of(out) is not None
    if exists:
        raise InputError(
            "the file exists; it may be somebody's work",
            where=str(out),
            allowed="a new file",
            hint="Name one by --out",
        )
    with shown_warnings(), progress() as listener:
        starter = starter_task(
            urdf_of(urdf),
            folder=out.parent,
            tool_frame=tool_frame,
            base_frame=base_frame,
            listener=listener,
        )
    write_text(starter.text, out)
    result, robot = starter.result, starter.robot
    if as_json:
        print_json(
            {
                "file": str(out),
                "joint_names": list(robot.joint_names),
                "tool_frame": robot.tool_frame,
                "t_end": result.t_end,
                "verified": result.verified,
            }
        )
        return
    console = result_console()
    console.print(
        f"wrote {out}: {robot.base_frame} -> {robot.tool_frame} with {', '.join(robot.joint_names)}"
    )
    console.print(
        f"a quick plan of it takes {result.t_end:.4f} s and is verified; next: brachis plan {out} --out out"
    )


def robots_command(*, as_json: bool) -> None:
    """List the robots that come with brachis."""
    listed = [
        {
            "name": name,
            "what": _what(robots.path_of(name)),
            "joints": list(getattr(robots, name).joint_names),
            "urdf": str(robots.path_of(name)),
        }
        for name in robots.names()
    ]
    if as_json:
        print_json({"robots": listed})
        return
    console = result_console()
    columns = ("name", "what it is", Column("joints", number=True), "their names")
    rows = [
        (each["name"], each["what"], len(each["joints"]), ", ".join(each["joints"]))
        for each in listed
    ]
    print_table(console, "robots that come with brachis", columns, rows)
    for each in listed:
        console.print(f"{each['name']}: {each['urdf']}")
    console.print(
        "A name may stand for the URDF: brachis inspect scara3, brachis new scara3"
    )


def _what(urdf: Path) -> str:
    """Read what a robot is from the heading of its page, ``# name: what it is``."""
    heading = urdf.with_name("README.md").read_text(encoding="utf-8").partition("\n")[0]
    return heading.partition(": ")[2]
