"""What limits are predicted to cost, beside solving again.

Usage: python benchmarks/sensitivities.py [--only PART ...] [--first 0] [--count 60] [--jobs 1] [--save]

--only takes names of parts: planar_lines, rail_arm, further, kinds; and seeded, which is another comparison.

The paper's eight lines with every decomposition, the TX90L on its rail with every closed form, two examples more, and
every kind of limit on three of the lines and on the TX90L. The derivative from the multipliers is compared with central
differences, every limit 0.03 % wider and narrower, and what it promises for +1 % with solving again at +1 %. The latter
differs by what is of second order, and by limits that take over within the step.

The part ``seeded`` plans the tasks of `process_tasks`, all of them or `--count` from the number `--first` on. Of each
it takes the costliest figures of three kinds, and a dwell, and changes them in the task by +1 %. It builds the program
anew from the changed task over the knots and collocation points of the optimum, and solves it and the unchanged one
from the motion that was planned. A joint path that is given is timed again. Savings that are off by more than 5 % are
compared at +0.1 % too; if they are off there as well they are faults.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import process_tasks
from brachis import LimitSpec, Result, Robot, Trajectory, load_task, plan
from brachis.apps.bottleneck import CheckedSensitivity, check_sensitivities
from brachis.errors import BrachisError, BrachisWarning, PlanningError
from brachis.explain import Sensitivity, multipliers_of
from brachis.limits.tool import PROCESS_SPEED
from brachis.optimise.backends import SolverOptions, SolverReport, solvers_for
from brachis.optimise.near_rows import solve_near_rows
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program, is_safeguard
from brachis.optimise.retiming import SOLVER
from brachis.optimise.transcription import boundary_of
from brachis.problem.problem import Problem
from brachis.task import Task
from brachis.task.limit_kinds import LIMIT_KINDS
from brachis.timing import find_timing_gap
from brachis.trajectory.sensitivities import TIMINGS
from committed import processor_time, save

ROOT = Path(__file__).parents[1]
STEP, SMALLER_STEP, SMALL_STEP = 0.01, 0.001, 0.0003
LARGE = 1e-4
REQUIRED = 0.05
COSTLIEST = 3
BALANCED = 0.02
"""Largest part of the gradient that multipliers may leave unbalanced."""
SOON = 0.5
"""s of processor time that reading the sensitivities may take."""
LEAST = 1e-5
"""Part of the end time that a row must promise to be compared."""
TIGHT = SolverOptions(tolerance=1e-8, time_limit=60.0)
FEASIBLE = 1e-7
STATIONARY = 1e-5
"""Part of the gradient that multipliers may leave unbalanced where a changed program is solved."""
LONGEST = 120.0
"""s of wall time for the plan of a seeded task; the default leaves too little on a busy machine."""
UNHURRIED = {"time_limit": 600.0}
"""No busy machine ends a search early."""
HELD = 0.7
"""Of what the motion without a limit reaches: what it may reach with it."""
CURVE = ((0.0, 1.0), (0.3, 1.0), (1.0, 0.3))
"""Torques over speeds, parts of what the free motion reaches."""


def planar_lines() -> Iterator[tuple[str, Result]]:
    """Yield the lines of examples/02 with every joint as the redundant one."""
    limits = LimitSpec(torque=10.0, velocity=None)
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )
    task = load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    for angle in range(0, 360, 45):
        for joint in ("j1", "j2", "j3"):
            line = [{"line": {"length": 1.0, "angle_deg": angle}}]
            yield (
                f"{angle} deg, {joint}",
                plan(
                    robot,
                    {
                        **task,
                        "path": line,
                        "redundant_joints": [joint],
                        "search": UNHURRIED,
                    },
                ),
            )


def rail_arm() -> Iterator[tuple[str, Result]]:
    """Yield the line of examples/03 with every joint that has a closed form as the redundant one."""
    task = load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict()
    for joint in ("rail", "joint_1", "joint_2", "joint_3"):
        yield (
            f"TX90L, {joint}",
            plan({**task, "redundant_joints": [joint], "search": UNHURRIED}),
        )


def further() -> Iterator[tuple[str, Result]]:
    """Yield examples with many active limits and with a joint that none limits."""
    for name in ("04_ur10_rail_weld", "06_free_roll"):
        yield (
            name,
            plan(
                {
                    **load_task(ROOT / f"examples/{name}.yaml").to_dict(),
                    "search": UNHURRIED,
                }
            ),
        )


def kinds() -> Iterator[tuple[str, Result]]:
    """Yield motions held back by every kind of limit that the free motion exceeds."""
    scara = load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    lines = {
        f"{angle} deg": [{"line": {"length": 1.0, "angle_deg": angle}}]
        for angle in (0, 45, 90)
    }
    tasks = {name: {**scara, "path": line} for name, line in lines.items()}
    tasks["TX90L"] = load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict()
    for name, task in tasks.items():
        single = {
            **task,
            "search": {**UNHURRIED, "effort": "single", "least_motion": False},
        }
        for kind, (joints, tool) in held_back(plan(single).trajectory).items():
            limits = {**(task["robot"].get("limits") or {}), **joints}
            robot = {**task["robot"], "limits": limits}
            yield (
                f"{name}, {kind}",
                plan({**single, "robot": robot, "tool_limits": tool}),
            )


def held_back(free: Trajectory) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Limits of joints and of the tool, by name, that a motion exceeds."""
    t = np.linspace(0.0, free.t_end, 4001)
    motion, names = free.at(t), free.joint_names
    positions, _ = free.robot.tool_placements(motion.q)
    velocity = np.gradient(positions, t, axis=0)
    speed = np.linalg.norm(velocity, axis=1).max()
    power = np.abs(motion.tau * motion.qdot)
    fastest, strongest = np.abs(motion.qdot).max(axis=0), np.abs(motion.tau).max(axis=0)
    rms = np.sqrt(np.trapezoid(motion.tau**2, t, axis=0) / free.t_end)
    jerk = np.abs(free.jerk(t)).max(axis=0)
    rate = np.abs(np.gradient(motion.tau, t, axis=0)).max(axis=0)
    curves = {
        name: [[x * v, y * tau] for x, y in CURVE]
        for name, v, tau in zip(names, fastest, strongest, strict=True)
    }
    return {
        "acceleration": (
            {"acceleration": (HELD * np.abs(motion.qddot).max(axis=0)).tolist()},
            {},
        ),
        "jerk": ({"jerk": (HELD * jerk).tolist()}, {}),
        "torque rate": ({"torque_rate": (HELD * rate).tolist()}, {}),
        "power": ({"power": (HELD * power.max(axis=0)).tolist()}, {}),
        "total power": (
            {
                "total_power": HELD
                * np.abs(np.sum(motion.tau * motion.qdot, axis=1)).max()
            },
            {},
        ),
        "torque that falls with speed": ({"torque_speed": curves}, {}),
        "rms torque": ({"rms_torque": (0.95 * rms).tolist()}, {}),
        "tool speed": ({}, {"speed": HELD * speed}),
        "tool acceleration": (
            {},
            {
                "acceleration": HELD
                * np.linalg.norm(np.gradient(velocity, t, axis=0)[5:-5], axis=1).max()
            },
        ),
        "process speed": (
            {},
            {"process_speed": {"speed": 0.4 * speed, "s": [0.3, 0.7]}},
        ),
    }


@dataclass(frozen=True)
class Compared:
    """One limit of one motion: wider by 1 %, by 0.1 %, and both ways by 0.03 %."""

    at_step: CheckedSensitivity
    nearer: CheckedSensitivity
    wider: CheckedSensitivity
    narrower: CheckedSensitivity

    @property
    def kind(self) -> str:
        label = self.at_step.sensitivity.label
        tool = "tool " if label.subject.startswith("tool") else ""
        return tool + label.kind.replace("force", "torque")

    @property
    def large(self) -> bool:
        return max(abs(self.at_step.predicted), abs(self.at_step.re_solved)) > LARGE

    @property
    def optimal(self) -> bool:
        return self.at_step.optimal and self.wider.optimal and self.narrower.optimal

    @property
    def central(self) -> float:
        """Change for `STEP` by central differences, s."""
        return (
            0.5 * (self.wider.re_solved - self.narrower.re_solved) * STEP / SMALL_STEP
        )

    @property
    def off(self) -> float:
        """How far the prediction is off it, as a fraction."""
        return (
            abs(self.at_step.predicted - self.central) / abs(self.central)
            if self.central
            else np.inf
        )

    def __str__(self) -> str:
        """Return the cells of its line."""
        entry = self.at_step
        limit = " ".join(
            filter(None, (str(entry.sensitivity.label), entry.sensitivity.side))
        )
        marks = ["not optimal"] * (not self.optimal) + ["> 5 %"] * (
            self.large and self.off > REQUIRED
        )
        marks += [f"other optimum {1e3 * entry.other_optimum:+.2f} ms"] * bool(
            entry.other_optimum
        )
        return (
            f"{limit} | {1e3 * entry.predicted:.4f} | {1e3 * self.central:.4f} | {100 * self.off:.2f} % "
            f"| {100 * self.nearer.deviation:.2f} % "
            f"| {1e3 * entry.re_solved:.4f} | {100 * entry.deviation:.2f} % "
            f"| {', '.join(marks)}"
        )


def compared(name: str, result: Result) -> list[Compared]:
    """Print a line for every limit that costs time."""
    refined = result.candidate.optimum
    found = result.sensitivities
    checks = [
        check_sensitivities(refined, found, step=step)
        for step in (STEP, SMALLER_STEP, SMALL_STEP, -SMALL_STEP)
    ]
    limits = [
        Compared(*entries)
        for entries in zip(*(check.entries for check in checks), strict=True)
    ]
    limits = [each for each in limits if each.at_step.predicted]
    for each in limits:
        print(
            f"| {name} | {checks[0].t_end:.4f} | {each} | {found.residual:.0e} |",
            flush=True,
        )
    return limits


def worst(title: str, limits: list[Compared]) -> tuple[str, ...]:
    """Line of the summary."""
    large = [each for each in limits if each.large]
    offs = [each.off for each in large]
    further = (
        ("nearer", "deviation"),
        ("at_step", "deviation"),
    )
    solved = [
        [getattr(getattr(each, check), figure) for each in large]
        for check, figure in further
    ]
    cells = [max(values, default=0.0) for values in (offs, *solved)]
    within = sum(off <= REQUIRED for off in offs)
    return (
        title,
        f"{within} of {len(large)}",
        *(f"{100 * cell:.1f} %" for cell in cells),
    )


@dataclass(frozen=True)
class Saving:
    """What a change of one figure of a task is predicted to save, and what it saves.

    Attributes
    ----------
    what : str
    predicted, found : float
        At `STEP`; of a dwell without it; s. What is found is NaN if the changed program was not solved.
    optimal : bool
        Whether both programs were solved to an optimum.
    nearer : (float, float) or None
        Both at `SMALLER_STEP`, if they differ at `STEP`.
    """

    what: str
    predicted: float
    found: float
    optimal: bool
    nearer: tuple[float, float] | None = None

    @property
    def off(self) -> float:
        """How far the prediction is off, as a fraction."""
        return fraction_off(self.predicted, self.found)

    @property
    def off_nearer(self) -> float:
        """The same at the smaller step, if it was needed."""
        return self.off if self.nearer is None else fraction_off(*self.nearer)

    def __str__(self) -> str:
        """Return the cells of its line."""
        near = "" if self.nearer is None else f"{100 * self.off_nearer:.2f} %"
        mark = "" if self.off_nearer <= REQUIRED else "FAULT"
        if not self.optimal:
            mark = "no optimum to compare with" if mark else "near an optimum"
        return (
            f"{self.what} | {1e3 * self.predicted:.4f} | {1e3 * self.found:.4f} | {100 * self.off:.2f} % | {near} "
            f"| {mark}"
        )


def fraction_off(predicted: float, found: float) -> float:
    """Return how far a prediction is off, as a fraction of what was found."""
    return abs(predicted - found) / abs(found) if found else np.inf


@dataclass(frozen=True)
class Seeded:
    """A task of `process_tasks`, planned and compared; `message` says why there is nothing to compare."""

    name: str
    t_end: float = np.nan
    source: str = ""
    residual: float = 0.0
    seconds: float = 0.0
    savings: tuple[Saving, ...] = ()
    message: str = ""


@dataclass(frozen=True, eq=False)
class Solved:
    """End time, s, of a program that was solved again; its answer x and whether that is an optimum."""

    t_end: float
    x: np.ndarray | None = None
    optimal: bool = True


def solve_tightly(program: Program, x: np.ndarray) -> Solved:
    """Solve from a point x, (v,), with one backend after the other until one finds an optimum."""
    answers = []
    for solver in solvers_for("auto"):

        def solve(problem: Any, x: np.ndarray, solver: Any = solver) -> SolverReport:
            return solver.solve(problem, x, TIGHT, None)

        report = solve_near_rows(program, x, solve)
        if report.violation > FEASIBLE:
            continue
        is_optimum = multipliers_of(program, report.x).residual <= STATIONARY
        answers.append(Solved(program.end_time(report.x), report.x, is_optimum))
        if is_optimum:
            return answers[-1]
    if not answers:
        raise PlanningError("no feasible motion was found")
    return min(answers, key=lambda answer: answer.t_end)


@dataclass(frozen=True, eq=False)
class Changes:
    """A planned task, and what it takes to plan it again with one figure changed.

    Attributes
    ----------
    task : Task
        As it was given.
    result : Result
    """

    task: Task
    result: Result

    @property
    def problem(self) -> Problem:
        return self.result.candidate.problem

    @property
    def scale(self) -> float:
        """End time of the optimum over that of the motion: predictions are of the motion."""
        optimum = self.result.candidate.optimum
        return optimum.t_end / self.result.candidate.refined.t_end

    @cached_property
    def starts(self) -> np.ndarray:
        """Postures at which the legs begin, (legs, n)."""
        motion = self.result.trajectory
        return motion.position(
            [phase.begin for phase in motion.phases if not phase.is_dwell]
        )

    @cached_property
    def unchanged(self) -> Solved:
        return self.solve(self.problem.robot, self.problem.task)

    def solve(
        self, robot: Robot, task: Task, begin: np.ndarray | None = None
    ) -> Solved:
        """Solve from the optimum, or from a point x, with another robot or task."""
        optimum = self.result.candidate.optimum
        problem = Problem.of(robot, task)
        if optimum.report.solver == SOLVER:
            gap = find_timing_gap(self.result.trajectory, problem.limits)
            return Solved(gap.least_time)
        phases = []
        for number, phase in enumerate(optimum.program.phases):
            joint_map = phase.joint_map
            leg, before = problem.legs[number], self.problem.legs[number]
            if (leg.begin, leg.end) != (before.begin, before.end):
                path = problem.leg_paths[number]
                joint_map = joint_map.along(path, self.starts[number])
            boundary = boundary_of(problem, joint_map, number)
            limits = (*problem.limits, *filter(is_safeguard, phase.limits))
            new = (joint_map, limits, phase.grid, boundary)
            phases.append(Phase(*new, margin=None, pause=leg.dwell))
        program = optimum.program.with_phases(phases)
        return solve_tightly(program, optimum.x if begin is None else begin)

    def saving(self, entry: Sensitivity) -> Saving:
        """Compare what a figure is predicted to save with solving again."""
        what = " ".join(filter(None, (str(entry.label), entry.side)))
        saving = Saving(what, -entry.change(STEP), *self._change(entry, STEP))
        if saving.off <= REQUIRED:
            return saving
        if not saving.optimal:
            saving = replace(saving, found=np.nan)
        found, optimal = self._change(entry, SMALLER_STEP)
        nearer = (-entry.change(SMALLER_STEP), found)
        return replace(saving, nearer=nearer, optimal=optimal)

    def _change(self, entry: Sensitivity, step: float) -> tuple[float, bool]:
        """Time saved by a figure that leaves more room by a fraction, s, and whether it is that of optima."""
        before = self.unchanged
        try:
            after = self.solve(*self._relax(entry, step), before.x)
        except PlanningError:
            return np.nan, False
        saved = (before.t_end - after.t_end) / self.scale
        return saved, before.optimal and after.optimal

    def _relax(self, entry: Sensitivity, step: float) -> tuple[Robot, Task]:
        """Change one figure of robot or task."""
        robot, task = self.problem.robot, self.problem.task
        value = entry.figure + entry.outwards * step * entry.full_scale
        key = entry.label.key.split(".", 3)
        if entry.label.cause == PROCESS_SPEED:
            return robot, self._with_speed(entry.figure, value)
        if key[:2] == ["robot", "limits"]:
            return self._relax_joint(entry, key[2], key[3], value), task
        limits = task.tool_limits.model_copy(update={key[1]: value})
        return robot, task.model_copy(update={"tool_limits": limits})

    def _relax_joint(
        self, entry: Sensitivity, kind: str, name: str, value: float
    ) -> Robot:
        robot = self.problem.robot
        column = robot.joint_names.index(name)
        fields = LIMIT_KINDS[kind].ends
        sides = {None: fields, "lower": fields[:1], "upper": fields[-1:]}[entry.side]
        ends = {}
        for field in sides:
            values = getattr(robot.limits, field).copy()
            values[column] = (
                np.copysign(value, values[column]) if entry.side is None else value
            )
            ends[field] = values
        return replace(robot, limits=replace(robot.limits, **ends))

    def _with_speed(self, speed: float, changed: float) -> Task:
        """Change a process speed, m/s, wherever the task has it."""

        def change(part: Any) -> Any:
            if part.speed is None or not np.isclose(part.speed, speed, rtol=1e-9):
                return part
            return part.model_copy(update={"speed": changed})

        limits = self.task.tool_limits
        parts = tuple(change(part) for part in limits.process_speed)
        path = tuple(change(segment) for segment in self.task.path)
        limits = limits.model_copy(update={"process_speed": parts})
        return self.problem.task.model_copy(
            update={"tool_limits": limits, "path": path}
        )

    def without_dwell(self) -> Saving | None:
        """Take the first dwell away, but stop; None if the task has none."""
        path = list(self.task.path)
        dwells = [number for number, segment in enumerate(path) if segment.dwell]
        if not dwells:
            return None
        (predicted,) = [
            saving.saved
            for saving in self.result.sensitivities.task
            if saving.change.startswith("without the dwell")
        ]
        still = {"dwell": 0.0, "stop": True}
        path[dwells[0]] = path[dwells[0]].model_copy(update=still)
        task = self.problem.task.model_copy(update={"path": tuple(path)})
        before = self.unchanged
        after = self.solve(self.problem.robot, task, before.x)
        optimal = before.optimal and after.optimal
        return Saving("dwell", predicted, before.t_end - after.t_end, optimal)


def costliest(entries: Iterable[Sensitivity], t_end: float) -> list[Sensitivity]:
    """Choose the figures of different kinds that change the end time most; a higher process speed may lengthen it."""
    chosen: dict[str, Sensitivity] = {}
    for entry in sorted(entries, key=lambda entry: -abs(entry.change(STEP))):
        of_tool = entry.label.subject == "tool"
        kind = entry.label.cause or f"{of_tool} {entry.label.kind}"
        if abs(entry.change(STEP)) > LEAST * t_end:
            chosen.setdefault(kind, entry)
    return list(chosen.values())[:COSTLIEST]


def compare_seeded(name: str, file: Path) -> Seeded:
    """Plan a task and compare what its figures are predicted to save."""
    warnings.simplefilter("ignore", BrachisWarning)
    task = load_task(file)
    search = task.search.model_copy(update={"time_limit": LONGEST, "jobs": 1})
    try:
        result = plan(
            task.model_copy(update={"search": search}), strict=False, check_advice=False
        )
    except BrachisError as error:
        return Seeded(name, message=f"no plan: {error}"[:200])
    began = processor_time()
    try:
        found = result.sensitivities
    except Exception as error:  # noqa: BLE001
        message = f"FAULT no sensitivities: {type(error).__name__}: {error}"
        return Seeded(name, result.t_end, message=message[:200])
    seconds = processor_time() - began
    seeded = Seeded(name, result.t_end, found.source, found.residual, seconds)
    if not result.verified:
        return replace(seeded, message="unverified")
    changes = Changes(task, result)
    savings = []
    try:
        savings += [changes.saving(e) for e in costliest(found.limits, result.t_end)]
        savings += filter(None, [changes.without_dwell()])
    except Exception as error:  # noqa: BLE001  (one that fails must not hide the others)
        message = f"FAULT not solved again: {type(error).__name__}: {error}"
        seeded = replace(seeded, message=message[:200])
    return replace(seeded, savings=tuple(savings))


def compare_all_seeded(numbers: range, jobs: int) -> None:
    """Print a line for every figure, then a summary."""
    columns = ("task", "t_E [s]", "multipliers", "residual", "read in [s]", "figure")
    columns += "predicted [ms]", "found [ms]", "off", "off at +0.1 %", "marks"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    plan(ROOT / "examples/01_scara_line.yaml").sensitivities  # noqa: B018  (imports)
    done = []
    with tempfile.TemporaryDirectory() as folder:
        tasks = list(process_tasks.seeded(Path(folder), numbers))
        for each in run_all(tasks, jobs):
            done.append(each)
            about = (
                f"{each.name} | {each.t_end:.4f} | {each.source} | {each.residual:.1e} "
                f"| {each.seconds:.3f}"
            )
            for saving in each.savings:
                print(f"| {about} | {saving} |", flush=True)
            if each.message or not each.savings:
                print(
                    f"| {about} | {each.message or 'nothing costs time'} |", flush=True
                )
    rows = [summarise(done)]
    columns = (
        "tasks",
        "figures",
        "within 5 % at +1 %",
        "worst",
        "within 5 % at +0.1 %",
    )
    columns += (
        "worst",
        "largest residual",
        f"residual below {BALANCED:.0%}",
        "longest to read",
    )
    print("\n" + "\n".join(" | ".join(row) for row in (columns, *rows)))
    about = (
        "Random tasks with process speeds, stops, dwells, limits on jerk and on the tool, and payloads: what the "
        "costliest figures of each are predicted to save, beside building and solving the changed task's program."
    )
    save("What figures of tasks cost", columns, rows, about, "sensitivities_of_tasks")


def run_all(tasks: list[tuple[str, Path]], jobs: int) -> Iterator[Seeded]:
    """Compare all tasks, in this process or in several."""
    if jobs == 1:
        yield from (compare_seeded(*task) for task in tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(compare_seeded, *zip(*tasks, strict=True))


def summarise(done: list[Seeded]) -> tuple[str, ...]:
    """Return the cells of the summary."""
    compared = [each for each in done if each.savings]
    savings = [saving for each in compared for saving in each.savings]
    off = np.array([saving.off for saving in savings])
    nearer = np.array([saving.off_nearer for saving in savings])
    of_multipliers = [each.residual for each in done if each.source != TIMINGS]
    balanced = sum(residual < BALANCED for residual in of_multipliers)
    slowest = max((each.seconds for each in done), default=0.0)
    slow = sum(each.seconds > SOON for each in done)
    return (
        f"{len(compared)} of {len(done)}",
        f"{len(savings)}",
        f"{np.sum(off <= REQUIRED)}",
        f"{100 * np.nanmax(off, initial=0.0):.1f} %",
        f"{np.sum(nearer <= REQUIRED)}",
        f"{100 * np.nanmax(nearer, initial=0.0):.1f} %",
        f"{max(of_multipliers, default=0.0):.1e}",
        f"{balanced} of {len(of_multipliers)}",
        f"{slowest:.2f} s ({slow} above {SOON:g} s)",
    )


PARTS = (planar_lines, rail_arm, further, kinds)


def compare_parts(parts: Iterable[Any]) -> None:
    """Print the table of parts of the first comparison, and the worst deviations."""
    columns = (
        "case",
        "t_E [s]",
        "limit",
        "predicted [ms]",
        "central [ms]",
        "off",
        "off at +0.1 %",
        "at +1 % [ms]",
    )
    columns += "off at +1 %", "marks", "residual"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    began, by_kind = processor_time(), defaultdict[str, list[Compared]](list)
    for case in parts:
        for name, result in case():
            for each in compared(name, result):
                by_kind[each.kind].append(each)
    everything = [each for limits in by_kind.values() for each in limits]
    rows = [worst(kind, limits) for kind, limits in by_kind.items()] + [
        worst("all", everything)
    ]
    columns = (
        "limit",
        "within 5 % of central differences",
        "largest difference",
        "from solving again, +0.1 %",
        "from solving again, +1 %",
    )
    print("\n" + "\n".join(" | ".join(row) for row in (columns, *rows)))
    print(
        f"solved again without an optimum: {sum(not each.optimal for each in everything)} of {len(everything)}"
    )
    print(f"{processor_time() - began:.1f} s of processor time in all")
    about = (
        "Changes of the end time by more than 0.1 ms for a limit that is 1 % wider: the derivative from the "
        "multipliers beside central differences over 0.03 % either way, then beside solving again with the limit 0.1 % "
        "and 1 % wider."
    )
    save("What limits cost, beside solving again", columns, rows, about)


def main() -> None:
    """Run all parts, or some."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = [part.__name__ for part in PARTS]
    parser.add_argument("--only", nargs="+", choices=[*names, "seeded"])
    parser.add_argument("--count", type=int, default=process_tasks.COUNT)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    given = parser.parse_args()
    chosen = given.only or [*names, "seeded"]
    parts = [part for part in PARTS if part.__name__ in chosen]
    if parts:
        compare_parts(parts)
    if "seeded" in chosen:
        end = min(given.first + given.count, process_tasks.COUNT)
        compare_all_seeded(range(given.first, end), given.jobs)


if __name__ == "__main__":
    main()
