"""``brachis import | compare``: motions that run today."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brachis.apps import comparison
from brachis.apps.cli.folder import (
    Writer,
    Written,
    make_folder,
    write_files,
    write_one,
    write_text,
)
from brachis.apps.cli.output import (
    Column,
    exit_code,
    json_text,
    print_error,
    print_json,
    print_table,
    print_verification,
    print_what_was_left,
    progress,
    result_console,
    shown_warnings,
)
from brachis.apps.cli.settings import task_space_of
from brachis.apps.recording import import_motion
from brachis.verify import verify_trajectory

if TYPE_CHECKING:
    from brachis.trajectory import Trajectory

_FILES = {
    True: ("today.npz", "result.npz", "comparison.json", "comparison.png"),
    False: (
        "today.npz",
        "unverified.npz",
        "unverified_comparison.json",
        "unverified_comparison.png",
    ),
}
"""Names of today's motion, the plan, the figures and the drawing, by whether the plan was verified."""


@dataclass(frozen=True)
class Recorded:
    """A recorded motion, as the command line names it.

    Attributes
    ----------
    file, robot : Path
        CSV file; URDF, or task file whose robot and settings hold.
    task_space, angle, length, time : str or None
    tolerance : float or None
        m and rad.
    noise : float or None
        rad or m.
    """

    file: Path
    robot: Path
    task_space: str | None
    angle: str | None
    length: str | None
    time: str | None
    tolerance: float | None
    noise: float | None

    def load(self) -> Trajectory:
        """Import the motion."""
        given = {"angle": self.angle, "length": self.length, "time": self.time}
        return import_motion(
            self.file,
            str(self.robot),
            task_space=None
            if self.task_space is None
            else task_space_of(self.task_space),
            units={name: unit for name, unit in given.items() if unit is not None},
            tolerance=self.tolerance,
            noise=self.noise,
        )


def import_command(
    recorded: Recorded, *, out: Path, degrees: bool, as_json: bool
) -> None:
    """Import a motion, verify and save it, and say what is known of it."""
    trajectory = recorded.load()
    write_one(out, trajectory.save, (".npz",), (recorded.file, recorded.robot))
    verification = verify_trajectory(trajectory)
    assert trajectory.recovered is not None
    if as_json:
        about = {
            "t_end": trajectory.t_end,
            "verified": verification.passed,
            "file": str(out),
        }
        print_json(
            {
                **about,
                "recovered": trajectory.recovered.to_dict(),
                "verification": verification.to_dict(),
            }
        )
        return
    console = result_console()
    console.print(f"end time t_E: {trajectory.t_end:.4f} s")
    for line in trajectory.recovered.told:
        console.print(line)
    print_verification(console, verification, degrees=degrees)
    console.print(
        "these ratios are of the motion that was made of the rows; the rows alone prove:"
    )
    for proven in comparison.bound_ratios(trajectory):
        ratio, subject, time = proven.worst
        console.print(f"{proven.limit} ratio {ratio:.4f}, {subject} at {time:.4f} s")
    console.print(f"wrote {out}")


def compare_command(
    recorded: Recorded, *, keep_end: bool, out: Path | None, as_json: bool
) -> int:
    """Import a motion, plan its path, and show both; returns the exit code."""
    if out is not None:
        make_folder(
            out, (*_FILES[True], *_FILES[False]), (recorded.file, recorded.robot)
        )
    with shown_warnings(), progress() as listener:
        found = comparison.compare(
            recorded.load(), keep_end=keep_end, listener=listener
        )
    data, written = found.to_dict(), Written((), ())
    if out is not None:
        written = _write(found, data, out)
        data["files"] = list(written.files)
    if as_json:
        print_json(data)
    else:
        _show(found, written.files)
    print_what_was_left(found.result.undone, interrupted=found.result.interrupted)
    if not found.result.verified:
        print_error(
            "the motion found did not pass the verification; it is marked unverified"
        )
    return exit_code(found.result.verified, written.failures)


def _write(found: comparison.Comparison, data: dict[str, Any], out: Path) -> Written:
    """Write both motions, the figures and the drawing."""
    from brachis.apps.plots import save_figure

    today, planned, figures_of_merit, drawing = _FILES[found.result.verified]
    results: dict[str, Writer] = {
        today: found.today.save,
        planned: found.result.trajectory.save,
        figures_of_merit: lambda path: write_text(json_text(data), path),
    }
    figures: dict[str, Writer] = {
        drawing: lambda path: save_figure(comparison.plot_today(found), path)
    }
    return write_files(
        out, results, figures, stale=_FILES[not found.result.verified][1:]
    )


def _show(found: comparison.Comparison, files: tuple[str, ...]) -> None:
    """Print the comparison for a person."""
    console = result_console()
    assert found.today.recovered is not None
    console.print(found.verdict)
    exceeded = (
        f"{len(found.exceeded)} exceeded"
        if found.exceeded
        else "kept, as far as rows tell"
    )
    if not found.proven:
        exceeded = "not known"
    rows = [
        (
            "end time t_E",
            f"{found.today.t_end:.4f} s",
            "",
            f"{found.result.t_end:.4f} s",
        ),
        *(
            (
                f"{use.limit}, used",
                f"{100 * use.today:.2f} % {use.today_at}",
                f"{100 * use.today_up_to:.2f} %",
                f"{100 * use.planned:.2f} % {use.planned_at}",
            )
            for use in found.uses
        ),
        (
            "limits",
            exceeded,
            "",
            "kept and verified" if found.result.verified else "NOT verified",
        ),
    ]
    columns = ("today", "between its rows up to", "planned")
    print_table(
        console, "", ("", *(Column(name, number=True) for name in columns)), rows
    )
    for line in (*found.remarks, *found.today.recovered.told):
        console.print(line)
    for name in files:
        console.print(f"wrote {name}")
