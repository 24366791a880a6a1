"""Sweeps: how much two processes gain over one, and whether sweeps survive what kills them.

    python benchmarks/sweeps.py                      # 1,000 plans; minutes
    python benchmarks/sweeps.py --plans 100 --only killed dask

speed    the same sweep in one process and in two, each the whole command with its start
killed   the sweep is killed (SIGKILL) at a random moment and run again
dask     on a local Dask cluster of two workers, started by command line, of which one is killed half-way

Every table is compared with that of the sweep that nothing disturbed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import yaml

import brachis

ROOT = Path(__file__).parents[1]
DASK = Path(sys.executable).with_name("dask")


def sweep_of(plans: int) -> dict:
    """Plans of the planar arm that are as small as they get: five intervals, one guess."""
    return {
        "sweep": 1,
        "task": str(ROOT / "examples/01_scara_line.yaml"),
        "fixed": {
            "search.effort": "single",
            "search.guesses": "numeric",
            "search.least_motion": False,
            "spline.intervals": 5,
        },
        "random": {
            "count": plans,
            "keys": {
                "path.0.line.angle_deg": {"uniform": [60.0, 120.0]},
                "path.0.line.length": {"uniform": [0.5, 1.0]},
                "robot.limits.scale.torque": {"log_uniform": [0.5, 2.0]},
            },
        },
    }


def command(source: Path, out: Path, jobs: int) -> list[str]:
    return [
        sys.executable,
        "-m",
        "brachis",
        "sweep",
        str(source),
        "--out",
        str(out),
        "--jobs",
        str(jobs),
        "--json",
    ]


def run(source: Path, out: Path, jobs: int) -> float:
    """Wall time of the whole command, s."""
    began = time.perf_counter()
    subprocess.run(command(source, out, jobs), check=True, capture_output=True)
    return time.perf_counter() - began


def finished(out: Path) -> int:
    return len(list(out.glob("plans/*/*.parquet")))


def wait_for(out: Path, plans: int) -> None:
    while finished(out) < plans:
        time.sleep(0.02)


def same(one: Path, other: Path) -> str:
    """Say whether two tables are the same; sums depend on how memory happens to be aligned, in their last digits."""
    tables = [brachis.SweepResult.load(out).table for out in (one, other)]
    exact = [
        table.drop(
            ["wall_time_s", "iterations", "worst_ratio", "path_error", "t_end_s"]
        )
        for table in tables
    ]
    times = [np.array(table.column("t_end_s").to_pylist(), float) for table in tables]
    off = np.nanmax(abs(times[0] / times[1] - 1.0))
    alike = (
        exact[0].equals(exact[1])
        and off < 1e-9
        and (np.isnan(times[0]) == np.isnan(times[1])).all()
    )
    return f"{'the same' if alike else 'ANOTHER'} table, end times to {off:.0e}"


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[Path, list[subprocess.Popen]]]:
    """A scheduler's file, and two workers."""
    file = folder / "scheduler.json"
    common = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--no-dashboard"]
    commands = [[DASK, "scheduler", "--port", "0", *common]]
    commands += [[DASK, "worker", "--nthreads", "1", "--no-nanny", *common]] * 2
    with (folder / "cluster.log").open("w") as log:
        started = [
            subprocess.Popen(each, cwd=folder, stdout=log, stderr=log)
            for each in commands
        ]
    try:
        while not file.exists():
            time.sleep(0.05)
        yield file, started[1:]
    finally:
        for process in started:
            process.kill()
            process.wait()


def speed(source: Path, folder: Path) -> str:
    one, two = run(source, folder / "one", 1), run(source, folder / "undisturbed", 2)
    planning = brachis.SweepResult.load(folder / "one").summary()["wall_time_s"]
    return (
        f"{one:.1f} s in one process ({planning:.1f} s of it planning), {two:.1f} s in two: {one / two:.2f} times as "
        f"fast; {same(folder / 'one', folder / 'undisturbed')}"
    )


def killed(source: Path, folder: Path, plans: int) -> str:
    at = int(np.random.default_rng().integers(1, plans))
    out = folder / "killed"
    with subprocess.Popen(
        command(source, out, 2), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        wait_for(out, at)
        process.kill()
    left = finished(out)
    run(source, out, 2)
    return f"killed with {left} of {plans} plans stored, then run again: {same(out, folder / 'undisturbed')}"


def on_dask(source: Path, folder: Path, plans: int) -> str:
    from distributed import Client

    def listener(text: str) -> None:
        if text.startswith(f"{plans // 2} of"):
            workers[0].kill()

    out = folder / "dask"
    with cluster(folder) as (file, workers):
        began = time.perf_counter()
        with Client(scheduler_file=str(file), set_as_default=False) as client:
            brachis.sweep(source, out, executor=client, listener=listener)
        took, dead = time.perf_counter() - began, workers[0].poll()
    return f"{took:.1f} s, one of two workers killed half-way ({dead}): {same(out, folder / 'undisturbed')}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--plans", type=int, default=1000)
    parser.add_argument(
        "--only",
        nargs="+",
        choices=["speed", "killed", "dask"],
        default=["speed", "killed", "dask"],
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = folder / "sweep.yaml"
        source.write_text(yaml.safe_dump(sweep_of(options.plans)))
        if "speed" in options.only:
            print("speed: ", speed(source, folder), flush=True)
        else:
            run(source, folder / "undisturbed", 2)
        if "killed" in options.only:
            print("killed:", killed(source, folder, options.plans), flush=True)
        if "dask" in options.only:
            print("dask:  ", on_dask(source, folder, options.plans), flush=True)


if __name__ == "__main__":
    main()
