"""Broken task files, URDFs, CSV files and results: each ends with an error of brachis or a valid outcome.

    python benchmarks/fuzz.py                    # 5000 cases; exit code 1 where one ends otherwise
    python benchmarks/fuzz.py --first 0 --cases 300
    python benchmarks/fuzz.py --only 1234        # one case again, here, with its traceback; its files are kept
    python benchmarks/fuzz.py --kinds result --cases 1000 --seconds 10 --memory 1000

Every case runs in a worker process that may take 60 s of processor time and 2 GB of memory beyond what its libraries
occupy. Another exception, a crash, a longer time or more memory is a fault and listed with the case's number. With
--memory the largest memory of the whole process counts too, in MB. With --kinds a number means another case.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import json
import os
import re
import resource
import select
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import brachis
import fuzz_cases
from brachis.apps.cli.inspection import inspect

_MEMORY = 2_000_000_000
_BUSY, _MAKING = 8.0, 30.0
"""Time per processor time on a busy machine, and time to make a case's files, s, before a worker is ended."""
_BASES = (
    {"redundant_joints": ["j3"]},
    {
        "redundant_joints": ["j1"],
        "spline": {"degree": 2, "intervals": 6, "rest": "velocity"},
    },
)


def results() -> tuple[bytes, ...]:
    """Plan the motions whose files are broken."""
    found = []
    for changes in _BASES:
        task = {
            "brachis": 1,
            "robot": {
                "urdf": str(fuzz_cases.ROBOTS / "scara3/robot.urdf"),
                "gravity": [0, 0, 0],
            },
            "start": {"joints": [0.5236, -2.0944, 2.0944]},
            "task_space": ["x", "y"],
            "path": [{"line": {"length": 0.3, "angle_deg": 90}}],
            "spline": {"degree": 3, "intervals": 6, "rest": "full"},
            **changes,
        }
        with tempfile.TemporaryDirectory() as folder:
            brachis.plan(task).trajectory.save(Path(folder) / "result.npz")
            found.append((Path(folder) / "result.npz").read_bytes())
    return tuple(found)


def run(case: fuzz_cases.Case, folder: Path) -> str:
    """Write a case's files, do what it says, and tell the outcome; other errors than brachis' own are passed on."""
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    outcome = "valid"
    for what in case.done:
        try:
            if what == "verify":
                trajectory = brachis.Trajectory.load(folder / "result.npz")
                brachis.verify_trajectory(trajectory)
            elif what == "plan":
                brachis.plan(folder / "task.yaml")
            else:
                inspect(folder / "robot.urdf", task_space="x,y", json=True)
        except brachis.BrachisError as error:
            outcome = type(error).__name__
            _ = str(error)
    return outcome


def work(kinds: tuple[str, ...]) -> None:
    """Answer numbers of cases on standard input with lines of JSON."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    faulthandler.enable()
    warnings.simplefilter("ignore")
    saved = results()
    occupied = (
        int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())[1])
        * 1024
    )
    resource.setrlimit(resource.RLIMIT_AS, (occupied + _MEMORY, resource.RLIM_INFINITY))
    print(json.dumps("ready"), file=answers)
    for line in sys.stdin:
        with tempfile.TemporaryDirectory() as folder:
            try:
                case = fuzz_cases.case(int(line), saved, kinds)
                began = time.process_time()
                answer = {
                    "kind": case.kind,
                    "outcome": run(case, Path(folder)),
                    "fault": None,
                }
                answer["seconds"] = time.process_time() - began
            except Exception as error:  # noqa: BLE001  (this is what is looked for)
                place = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{Path(place.filename).name}:{place.lineno}"
                answer = {
                    "kind": case.kind,
                    "outcome": "fault",
                    "fault": f"{type(error).__name__} at {where}: {error}",
                }
        answer["peak"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        print(json.dumps(answer), file=answers)


class Worker:
    """A process that runs cases, and is started again where one of them ends it."""

    def __init__(self, kinds: tuple[str, ...], memory: float) -> None:
        self._kinds, self._memory = kinds, memory
        self._start()

    def _start(self) -> None:
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115
        command = [sys.executable, __file__, "--worker", "--kinds", *self._kinds]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=self._errors, text=True
        )
        self._process.stdout.readline()

    def run(self, number: int, seconds: float) -> dict[str, str | None]:
        """Run a case; a crash and a hang are faults."""
        kind = self._kinds[number % len(self._kinds)]
        print(number, file=self._process.stdin, flush=True)
        ready, _, _ = select.select(
            [self._process.stdout], [], [], _BUSY * seconds + _MAKING
        )
        line = self._process.stdout.readline() if ready else ""
        if line:
            answer = json.loads(line)
            if answer["peak"] > self._memory:
                answer["fault"] = answer["fault"] or f"{answer['peak'] / 1e6:.0f} MB"
                self.end()
                self._start()
            if answer.get("seconds", 0.0) > seconds:
                answer["fault"] = answer["fault"] or f"{answer['seconds']:.1f} s"
            return answer
        if not ready:
            self._process.kill()
        code = self._process.wait()
        self._errors.seek(0)
        said = " ".join(self._errors.read().split())[-300:]
        self.end()
        self._start()
        fault = (
            f"crash with code {code}: {said}"
            if ready
            else f"no end within {_BUSY * seconds + _MAKING:g} s"
        )
        return {"kind": kind, "outcome": "fault", "fault": fault}

    def end(self) -> None:
        """End the process."""
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            with contextlib.suppress(OSError):
                stream.close()
        self._process.wait()


def search(
    numbers: range, seconds: float, kinds: tuple[str, ...], memory: float
) -> int:
    """Run cases, print what came out; 1 where a fault was found."""
    cases, first = len(numbers), numbers.start
    counts: Counter[tuple[str, str]] = Counter()
    faults = []
    worker = Worker(kinds, memory)
    began = time.perf_counter()
    slowest = (0.0, first)
    largest = 0.0
    for number in numbers:
        answer = worker.run(number, seconds)
        slowest = max(slowest, (answer.get("seconds", 0.0), number))
        largest = max(largest, answer.get("peak", 0.0))
        counts[answer["kind"], answer["outcome"]] += 1
        if answer["fault"] is not None:
            faults.append(number)
            print(
                f"case {number} ({answer['kind']}): {answer['fault'][:400]}", flush=True
            )
    worker.end()
    for (kind, outcome), count in sorted(counts.items()):
        print(f"{kind:13} {outcome:20} {count:5}")
    print(
        f"{cases} cases in {time.perf_counter() - began:.0f} s, slowest {slowest[0]:.1f} s (case {slowest[1]})"
    )
    print(f"largest process {largest / 1e6:.0f} MB")
    print(
        f"{len(faults)} faults" + (f": {' '.join(map(str, faults))}" if faults else "")
    )
    return 1 if faults else 0


def again(number: int, kinds: tuple[str, ...]) -> None:
    """Run one case in this process, without limits."""
    case = fuzz_cases.case(number, results(), kinds)
    folder = Path(tempfile.mkdtemp(prefix=f"fuzz-{number}-"))
    print(f"{case.kind}, files in {folder}", flush=True)
    print(run(case, folder))


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Fuzz the reading of tasks, URDFs, CSV files and results."
    )
    parser.add_argument("--cases", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", type=int)
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="of one case, of processor time"
    )
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument(
        "--memory",
        type=float,
        default=float("inf"),
        help="largest memory of the process, MB",
    )
    parser.add_argument(
        "--kinds", nargs="+", default=[""], help="what the names of kinds begin with"
    )
    given = parser.parse_args()
    kinds = tuple(
        kind for kind in fuzz_cases.KINDS if kind.startswith(tuple(given.kinds))
    )
    if given.worker:
        work(kinds)
    elif given.only is not None:
        again(given.only, kinds)
    else:
        numbers = range(given.first, given.first + given.cases)
        return search(numbers, given.seconds, kinds, given.memory * 1e6)
    return 0


if __name__ == "__main__":
    sys.exit(main())
