"""Programs of parts: known optima, one optimum over all parts, links, orders, and programs that cannot be planned.

The full count of programs is `benchmarks/programs.py`.
"""

import itertools
from functools import partial

import numpy as np
import pytest

import brachis
from brachis.common.deadline import NEVER
from brachis.common.progress import ignore
from brachis.errors import (
    InputError,
    PathError,
    PlausibilityError,
    StartError,
    TaskError,
)
from brachis.optimise.links import PostureLink
from brachis.optimise.path_phase import PathPhase
from brachis.optimise.path_program import PathProgram
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.transcription import program_of
from brachis.problem.plausibility import of_places
from brachis.problem.program import bind_task
from brachis.robot.from_task import robot_for, robot_from_settings
from brachis.robot.plausibility import PlausibilityWarning
from brachis.search.chain import find_batches
from brachis.search.least_motion import least_acceleration
from brachis.search.phase_plane import initial_guess
from brachis.task import ToolLimits, part_names, scene_during, task_with
from support.cycle import CYCLE as GANTRY_CYCLE
from support.effort import QUICK
from support.slides import X, slides

MASS = 2.0
FORCE = 16.0
"""Of a slide, N."""
HOME = [0.0, 0.5, 0.0, -1.2, 0.0, 1.0, 0.3]
ARC = {"name": "arc_on"}
SEAM = {
    "name": "seam",
    "path": [{"line": {"to": [0.5, 0.15, 0.4]}}],
    "path_start": {"position": [0.5, -0.15, 0.4], "rpy_deg": [180, 0, 0]},
    "events": [
        {"name": "arc_on", "lead": 0.02},
        {"name": "arc_off", "at": "end", "lead": -0.01},
    ],
}
FAST = {"tool_limits": {"process_speed": {"speed": 0.2, "s": [0.2, 0.8]}}}
CYCLE = {
    "start": HOME,
    "end": "start",
    "task_space": "pose_free_roll",
    "program": [
        {"move": "next"},
        {"approach": 0.05},
        SEAM,
        {"dwell": 0.1},
        {"retract": 0.05},
        {"move": {"joints": HOME}},
    ],
}


@pytest.fixture(scope="module")
def slide():
    return slides([X], [FORCE], MASS, gravity=[0, 0, 0])


@pytest.fixture(scope="module")
def cycle():
    return brachis.plan("iiwa14", **CYCLE, **QUICK)


def least_time(distance):
    """Of a slide from rest to rest, by full force either way, s."""
    return 2.0 * np.sqrt(distance * MASS / FORCE)


def plan_slide(slide, parts, **keys):
    return brachis.plan(slide, program=parts, rest="velocity", **QUICK, **keys)


def test_a_slide_goes_there_and_back(slide):
    there = {"move": {"joints": [0.5]}}
    back = {"move": {"joints": [0.0]}}
    result = plan_slide(slide, [there, back], start=[0.0], end="start")
    assert result.verified
    assert result.t_end == pytest.approx(2.0 * least_time(0.5), rel=1e-3)
    assert result.t_end >= 2.0 * least_time(0.5) * (1.0 - 1e-4)


def test_two_moves_with_a_dwell_between_them(slide):
    parts = [
        {"move": {"joints": [0.5]}},
        {"dwell": 0.3},
        {"move": {"joints": [0.7]}},
    ]
    result = plan_slide(slide, parts, start=[0.0])
    assert result.verified
    ways = [least_time(0.5), 0.3, least_time(0.2)]
    durations = [part.duration for part in result.trajectory.parts]
    np.testing.assert_allclose(durations, ways, rtol=1e-3)


@pytest.mark.parametrize("moves", [[0.0], [0.0, 0.5], [0.5, 0.5], [0.5, 0.0]])
def test_a_move_to_where_the_arm_is_is_refused(slide, moves):
    program = [{"move": {"joints": [place]}} for place in moves]
    wrong = {(0.5, 0.5): 1, (0.5, 0.0): 2}.get(tuple(moves), 0)
    program.append({"move": {"joints": [0.0]}})
    with pytest.raises(PathError, match=rf"program\[{wrong}\].move: .*already in this"):
        plan_slide(slide, program, start=[0.0])


def test_a_path_that_begins_where_the_arm_is_needs_no_move(slide):
    def path_from(begin, end):
        return {"path": [{"line": {"to": [end]}}], "path_start": [begin]}

    keys = {"start": [0.0], "task_space": ["x"]}
    with pytest.raises(PathError, match="move 1: the arm is already in this posture"):
        plan_slide(slide, [{"move": "next"}, path_from(0.1, 0.5)], **keys)
    paths = [path_from(0.2, 0.3), path_from(0.3, 0.5)]
    result = plan_slide(slide, paths, order="free", **keys)
    assert [part.kind for part in result.trajectory.parts] == ["move", "path", "path"]


def test_a_closed_motion_without_a_given_start(slide):
    there = {"path": [{"line": {"by": [0.4]}}], "path_start": [0.3]}
    parts = [there, {"move": "next"}]
    result = plan_slide(slide, parts, task_space=["x"], end="start")
    assert result.verified
    assert result.t_end == pytest.approx(2.0 * least_time(0.4), rel=1e-3)
    first, last = result.trajectory.q[[0, -1]]
    assert abs(last - first).max() < 1e-9


def test_a_program_of_one_path_is_that_path():
    path = {"path": [{"line": {"by": [0.0, 0.3]}}]}
    keys = {"task_space": ["x", "y"], "start": [0.5, -1.0, 1.2], **QUICK}
    alone = brachis.plan("scara3", **path, **keys)
    as_program = brachis.plan("scara3", program=[path], **keys)
    assert as_program.verified
    assert as_program.t_end == pytest.approx(alone.t_end, rel=2e-3)


def test_a_cycle_is_verified_and_has_its_parts(cycle):
    assert cycle.verified
    motion = cycle.trajectory
    kinds = [part.kind for part in motion.parts]
    assert kinds == ["move", "approach", "path", "dwell", "retract", "move"]
    ends = [part.end for part in motion.parts]
    begins = [part.begin for part in motion.parts]
    np.testing.assert_allclose(begins, [0.0, *ends[:-1]], atol=1e-12)
    assert ends[-1] == pytest.approx(motion.t_end)
    seam = motion.parts[2]
    assert motion.parts[3].duration == pytest.approx(0.1)
    events = {event.name: event.time for event in motion.events}
    assert events["arc_on"] == pytest.approx(seam.begin - 0.02)
    assert events["arc_off"] == pytest.approx(seam.end + 0.01)
    np.testing.assert_allclose(motion.q[[0, -1]], [HOME, HOME], atol=1e-9)


def test_checks_name_the_part_to_which_they_belong(cycle):
    subjects = {check.name: check.subject for check in cycle.verification.checks}
    for name in ("duration of dwells", "velocity in dwells"):
        assert subjects[name].endswith(", dwell 1")
    assert subjects["end velocity"].endswith(", move 1")
    assert "e-" not in cycle.trajectory.summary()["end posture"]


def test_the_tool_is_on_the_seam_and_on_its_approach(cycle):
    """By Pinocchio's placement of the whole motion at the times of the parts."""
    motion = cycle.trajectory
    approach, seam, _, retract = motion.parts[1:5]
    t = np.linspace(seam.begin, seam.end, 41)
    places, rotations = motion.robot.tool_placements(motion.position(t))
    np.testing.assert_allclose(places[:, [0, 2]], [[0.5, 0.4]] * 41, atol=1e-8)
    np.testing.assert_allclose(places[[0, -1], 1], [-0.15, 0.15], atol=1e-8)
    np.testing.assert_allclose(rotations[:, :, 2], [[0.0, 0.0, -1.0]] * 41, atol=1e-8)
    ends = np.array([approach.begin, retract.end])
    places, _ = motion.robot.tool_placements(motion.position(ends))
    np.testing.assert_allclose(
        places, [[0.5, -0.15, 0.45], [0.5, 0.15, 0.45]], atol=1e-8
    )


def test_one_optimum_is_faster_than_part_by_part(cycle):
    """The seam is planned for itself, then the moves to where it begins and from where it ends."""
    keys = {key: SEAM[key] for key in ("path", "path_start")}
    space = {"task_space": "pose_free_roll", "start": "free"}
    seam = brachis.plan("iiwa14", **keys, **space, **QUICK)
    first, last = seam.trajectory.q[[0, -1], :7]
    there = brachis.plan("iiwa14", start=HOME, end=first, task_space="free", **QUICK)
    back = brachis.plan("iiwa14", start=last, end=HOME, task_space="free", **QUICK)
    total = there.t_end + seam.t_end + back.t_end + 0.1
    assert cycle.t_end < 0.97 * total


def test_a_saved_cycle_is_the_same(cycle, tmp_path):
    file = tmp_path / "cycle.npz"
    cycle.save(file)
    loaded = brachis.Trajectory.load(file)
    assert loaded.parts == cycle.trajectory.parts
    assert loaded.events == cycle.trajectory.events
    assert len(loaded.components) == 3
    assert brachis.verify_trajectory(loaded).passed


def test_the_verification_sees_a_part_that_moved(cycle):
    motion = cycle.trajectory
    q = motion.q + np.array([0.0] * 6 + [1e-4])
    moved = type(motion)(**{**vars_of(motion), "q": q})
    failures = " ".join(brachis.verify_trajectory(moved).failures)
    assert "motion of the parts" in failures


def vars_of(motion):
    """Fields of a trajectory, without what it keeps of its own computations."""
    return {name: getattr(motion, name) for name in type(motion).__dataclass_fields__}


def test_a_payload_counts_from_its_place_on(slide):
    moves = [{"move": {"joints": [0.5]}}, {"move": {"joints": [0.0]}}]
    loaded = [moves[0], {"payload": {"mass": 2.0}}, moves[1]]
    result = plan_slide(slide, loaded, start=[0.0])
    assert result.verified
    durations = [part.duration for part in result.trajectory.parts]
    ratio = np.sqrt((MASS + 2.0) / MASS)
    assert durations[1] == pytest.approx(ratio * durations[0], rel=1e-3)


def test_limits_of_a_part_hold_in_it_alone(slide):
    moves = [
        {"move": {"joints": [0.5]}, "limits": {"velocity": 0.5}},
        {"move": {"joints": [0.0]}},
    ]
    result = plan_slide(slide, moves, start=[0.0])
    assert result.verified
    first, second = (part.duration for part in result.trajectory.parts)
    assert first == pytest.approx(0.5 / 0.5 + 0.5 * MASS / FORCE, rel=1e-3)
    assert second == pytest.approx(least_time(0.5), rel=1e-3)


@pytest.mark.parametrize(
    "robot, limits, velocity",
    [
        ({"speed_override": 0.25}, {"velocity": 2.0}, 0.5),
        ({"speed_override": 0.25}, {"scale": {"velocity": 0.5}}, 0.25),
        ({"limits": {"scale": {"velocity": 0.25}}}, {"velocity": {"x_axis": 2.0}}, 0.5),
        ({"limits": {"scale": {"velocity": 0.25}}}, {"scale": {"velocity": 0.5}}, 1.0),
        ({"limits": {"velocity": 0.25}}, {"acceleration": 100.0}, 0.25),
    ],
)
def test_a_part_replaces_the_same_limits_and_no_factors(robot, limits, velocity):
    task = task_with(
        robot={"urdf": "gantry2", **robot},
        start=[0.1, 0.1],
        tool_limits={"speed": 0.2},
        program=[
            {
                "move": {"joints": [0.9, 0.1]},
                "limits": limits,
                "tool_limits": {"acceleration": 100.0},
            }
        ],
    )
    (part,) = bind_task(robot_from_settings(task.robot), task).parts
    assert part.robot.limits.velocity[0] == pytest.approx(velocity)
    assert part.task.tool_limits == ToolLimits(speed=0.2, acceleration=100.0)


@pytest.mark.parametrize(
    "parts, key",
    [
        ([{"payload": {"mass": 60.0}}], "program[1].payload.mass"),
        ([], "robot.payload.mass"),
    ],
)
def test_the_payload_that_is_too_heavy_is_named(parts, key):
    home = {"joints": HOME}
    program = [{"move": {"joints": [0.3, *HOME[1:]]}}, *parts, {"move": home}]
    robot = {"urdf": "iiwa14"} | ({} if parts else {"payload": {"mass": 60.0}})
    task = task_with(robot=robot, start=home, program=program)
    with pytest.raises(StartError) as caught:
        bind_task(robot_from_settings(task.robot), task)
    (remedy,) = caught.value.remedies
    assert remedy.key == key


@pytest.mark.parametrize(
    "number, changes, text",
    [
        (
            0,
            {"limits": {"velocity": 1e-7}},
            r"program: move 1: .*Set program\[0\].limits.velocity.x_axis in",
        ),
        (
            1,
            {"path": [{"line": {"by": [0.1, 0.2]}, "speed": 50.0}], "tool_limits": {}},
            r"Lower program\[1\].path\[0\].speed to .* \(a plan with it was verified",
        ),
    ],
)
def test_keys_of_parts_are_named_in_advice_that_works(number, changes, text):
    parts = list(GANTRY_CYCLE["program"])
    parts[number] = {**parts[number], **changes}
    with pytest.raises(brachis.BrachisError, match=text):
        brachis.plan({**GANTRY_CYCLE, "program": parts})


def test_figures_of_parts_are_checked_like_those_of_the_task():
    parts = list(GANTRY_CYCLE["program"])
    parts[0] = {"move": "next", "limits": {"velocity": {"x_axis": 5000.0}}}
    parts[3] = {"payload": {"mass": 1500.0}}
    task = task_with({**GANTRY_CYCLE, "program": parts})
    issues = of_places(bind_task(robot_from_settings(task.robot), task))
    assert [issue.where for issue in issues] == [
        "program[0].limits.velocity.x_axis",
        "program[3].payload.mass",
    ]


def test_two_paths_with_different_limits_meet(slide):
    parts = [
        {"path": [{"line": {"by": [0.5]}}], "limits": {"velocity": 0.5}},
        {"path": [{"line": {"by": [0.3]}}]},
    ]
    result = plan_slide(slide, parts, task_space=["x"], start=[0.0])
    assert result.verified
    slow, fast = (part.duration for part in result.trajectory.parts)
    assert slow == pytest.approx(0.5 / 0.5 + 0.5 * MASS / FORCE, rel=1e-3)
    assert fast == pytest.approx(least_time(0.3), rel=1e-3)


def test_a_given_speed_is_held_in_a_program():
    seam = {
        "path": [{"line": {"by": [0.0, 0.4]}, "speed": 0.5}],
        "path_start": [0.3, 0.2],
        "name": "seam",
    }
    home = {"move": {"joints": [0.0, 0.0]}}
    keys = {"start": [0.0, 0.0], "end": "start", "task_space": ["x", "y"]}
    program = [{"move": "next"}, seam, home]
    result = brachis.plan("gantry2", program=program, **keys, **QUICK)
    assert result.verified
    assert result.smoothing == "off"
    begin, component = result.trajectory.components[1]
    held = [phase for phase in component.phases if phase.speed]
    assert [phase.speed for phase in held] == [0.5]
    t = np.linspace(held[0].begin, held[0].end, 21)
    # The joints of a gantry are the coordinates of its tool.
    speeds = np.linalg.norm(result.trajectory.velocity(begin + t), axis=1)
    np.testing.assert_allclose(speeds, 0.5, rtol=1e-6)


def test_no_joint_swings_on_a_seam_with_a_given_speed():
    """Without limits on accelerations, the roll of the tool costs no time: it reached 21,000 rad/s^2."""
    seam = {
        "path": [{"line": {"by": [0.0, 0.12, 0.0]}, "speed": 0.1}],
        "path_start": {"position": [0.6, 0.0, 0.4], "rpy_deg": [180, 10, 0]},
    }
    result = brachis.plan(
        "ur10_rail",
        start=[0.0, 0.0, -1.2, 1.6, -2.0, -1.57, 0.0],
        task_space="pose_free_roll",
        program=[{"move": "next"}, seam],
        **{**QUICK, "least_motion": True},
    )
    assert result.verified
    _, motion = result.trajectory.components[1]
    accelerations = motion.acceleration(np.linspace(0.0, motion.t_end, 2001))
    # Each joint reaches its speed on the first and last millimetres.
    assert np.abs(accelerations).max() < 500.0
    assert np.sqrt((accelerations**2).mean(axis=0)).max() < 20.0


def test_accelerations_of_parts_with_virtual_joints_and_without_are_one_objective(
    cycle,
):
    optimum = cycle.candidate.optimum
    sizes = {phase.joint_map.robot.n for phase in optimum.program.phases}
    assert sizes == {7, 8}
    objective = least_acceleration(optimum.program, optimum.x, 0.0)
    assert len(objective.weights) == 7
    program = optimum.program.with_objective(objective)
    assert program.objective(optimum.x) == pytest.approx(1.0)
    # In half of the time, accelerations are four times as high.
    faster = program.scale_time(optimum.x, 0.5)
    assert program.objective(faster) == pytest.approx(16.0)
    step = 1e-6 * np.random.default_rng(1).normal(size=len(optimum.x))
    x = optimum.x
    change = program.objective(x + step) - program.objective(x - step)
    assert program.gradient(x) @ step == pytest.approx(0.5 * change, rel=1e-4)


def test_pairs_of_a_body_that_is_there_for_a_time_can_be_left_out():
    post = {"name": "post", "sphere": 0.02, "position": [0.3, 0.2, 0.0]}
    task = {
        **GANTRY_CYCLE,
        "scene": [{**post, "until": "payload 1"}],
        "collisions": {
            "capsules": "auto",
            "self_collision": False,
            "disable": [[name, "post"] for name in ("base", "bridge", "tool")],
        },
    }
    assert brachis.plan(task).verified


def test_bodies_are_there_between_their_parts():
    parts = brachis.Program(
        [{"move": "next"}, {**SEAM, "name": "lower"}, {"dwell": 0.1, "name": "grip"}]
    )
    ball = {"name": "ball", "sphere": 0.1}
    lives = [{}, {"until": "lower"}, {"since": "lower"}, {"since": "grip"}]
    scene = [
        brachis.Sphere(0.1, name=f"ball {number}").model_copy(update=life)
        for number, life in enumerate(lives)
    ]
    there = [
        [int(body.name[-1]) for body in scene_during(scene, parts, number)]
        for number in range(3)
    ]
    assert there == [[0, 1], [0, 2], [0, 2, 3]]
    with pytest.raises(TaskError, match="no part of the program has this name"):
        brachis.plan("iiwa14", **CYCLE, scene=[{**ball, "until": "nowhere"}])


@pytest.fixture(scope="module", params=[False, True], ids=["stops", "flies"])
def linked(request):
    """A chain of a move, a seam and a move, with its program and a point of it."""
    program = [
        {"move": "next", "fly": request.param},
        {**SEAM, "fly": request.param},
        {"move": {"joints": HOME}},
    ]
    keys = {**CYCLE, "start": {"joints": HOME}, "program": program}
    task = brachis.load_task({"brachis": 1, "robot": {"urdf": "iiwa14"}, **keys})
    problem = bind_task(robot_for(None, task.robot), task)
    (guess, *_) = next(find_batches(problem, [], NEVER, ignore)).guesses
    program = program_of(guess.problem, guess.maps_by_leg())
    return problem, program, initial_guess(program, guess)


def test_slopes_of_links_agree_with_differences(linked):
    _, program, x = linked
    links = [link for link in program.links if isinstance(link, PostureLink)]
    assert len(links) == 2
    rng = np.random.default_rng(3)
    direction = rng.normal(size=len(x)) * (program.x_lower < program.x_upper)
    step = 1e-6 * direction
    for link in links:
        rows, columns = link.pattern(program.phases, program.first_variables)
        entries = link.jacobian(program.split(x))
        dense = np.zeros((link.size, len(x)))
        np.add.at(dense, (rows, columns), entries)
        ahead, behind = (link.rows(program.split(x + sign * step)) for sign in (1, -1))
        np.testing.assert_allclose(
            dense @ direction, 0.5e6 * (ahead - behind), rtol=1e-5, atol=1e-6
        )


def over_path_of(program, x):
    """Make the program over the path that starts from the joint paths of a motion x."""
    phases = []
    at_rest = program.at_rest()
    for phase, motion in zip(at_rest.phases, program.motions(x), strict=True):
        curves = motion.at(np.linspace(0.0, motion.t_end, 201))[0]
        timing = PhaseTiming.through(phase, curves, 200)
        phases.append(PathPhase(phase, timing, 4, 14))
    return PathProgram(phases, at_rest.links)


def test_slopes_of_the_program_over_the_path_agree_with_differences(linked):
    problem, program, x = linked
    over_path = over_path_of(program, x)
    program = program.at_rest()
    x = over_path.start
    dense = np.zeros((len(over_path.lower), len(x)))
    places = (over_path.jacobian_rows, over_path.jacobian_columns)
    np.add.at(dense, places, over_path.jacobian(x))
    rng = np.random.default_rng(4)
    direction = rng.normal(size=len(x)) * (over_path.x_lower < over_path.x_upper)
    step = 1e-6 * direction
    change = over_path.rows(x + step) - over_path.rows(x - step)
    count = sum(link.size for link in program.links)
    linked_rows = slice(len(change) - count, None)
    np.testing.assert_allclose(
        (dense @ direction)[linked_rows], 0.5e6 * change[linked_rows], atol=1e-6
    )
    met = over_path.meet(x)
    assert np.abs(over_path.rows(met)[linked_rows]).max() < 1e-12
    assert len(problem.joins) == 2


def test_the_path_coordinate_of_a_move_cannot_race(linked):
    """Its tangents could vanish where it races, at no cost, and between stations no limit would hold."""
    _, program, x = linked
    over_path = over_path_of(program, x)
    for phase, start in over_path.split(over_path.start):
        fastest = np.where(np.isfinite(phase.x_upper), phase.x_upper, 1e12 * start)
        ratio = phase.time(fastest) / phase.time(start)
        assert (ratio > 0.1) == phase.joint_map.is_move


@pytest.mark.parametrize("seed", range(3))
def test_orders_are_the_best_of_all(slide, seed):
    """Against all permutations of lines on a slide, and their known times."""
    rng = np.random.default_rng(seed)
    begins = rng.uniform(0.5, 3.0, 5).round(3)
    ends = begins + rng.choice([-0.3, 0.3], 5)
    seams = [
        {"path": [{"line": {"to": [end]}}], "path_start": [begin], "name": f"{number}"}
        for number, (begin, end) in enumerate(zip(begins, ends, strict=True))
    ]
    times = {}
    for order in itertools.permutations(range(5)):
        stops = [0.0, *np.column_stack([begins, ends])[list(order)].ravel(), 2.0]
        times[order] = least_time(np.abs(np.diff(stops))).sum()
    task = brachis.load_task(
        {
            "brachis": 1,
            "robot": {"urdf": "slide"},
            "start": {"joints": [0.0]},
            "end": {"joints": [2.0]},
            "program": seams,
            "order": "free",
            "task_space": ["x"],
            "spline": {"rest": "velocity"},
        }
    )
    problem = bind_task(slide, task)
    batch = next(find_batches(problem, (), NEVER, ignore))
    sections = [
        section for part in batch.guesses[0].problem.sections for section in part
    ]
    order = [int(section.name) for section in sections if section.kind == "path"]
    assert times[tuple(order)] == pytest.approx(min(times.values()))


def test_a_free_order_has_joint_paths_beside_each_other(bench):
    """Planned in full, this order took 3.0045 s. Close to the start alone, the best order was another, 8 % slower."""
    programs = bench("programs")
    seams = programs.draw_seams("iiwa14", 2, 5)
    keys = {"order": "free", "end": {"joints": programs.HOMES["iiwa14"]}}
    task = brachis.load_task(programs.task_of("iiwa14", seams, **keys))
    problem = bind_task(robot_for(None, task.robot), task)
    guess = next(find_batches(problem, (), NEVER, ignore)).guesses[0]
    sections = itertools.chain.from_iterable(guess.problem.sections)
    names = [section.name for section in sections if section.kind == "path"]
    assert names == [f"seam {number}" for number in (1, 2, 4, 0, 3)]


def test_a_free_order_visits_seams_along_the_way():
    """Lines on a slide's way, listed out of order: the best order sweeps over them."""
    slide = slides([X], [FORCE], MASS, gravity=[0, 0, 0])
    seams = [
        {"path": [{"line": {"by": [0.1]}}], "path_start": [x], "name": f"at {x}"}
        for x in (0.9, 0.3, 1.5)
    ]
    result = plan_slide(
        slide, seams, task_space=["x"], order="free", start=[0.0], end=[2.0]
    )
    assert result.verified
    names = [part.name for part in result.trajectory.parts if part.kind == "path"]
    assert names == ["at 0.3", "at 0.9", "at 1.5"]
    moves = [part.name for part in result.trajectory.parts if part.kind == "move"]
    assert moves == ["to at 0.3", "to at 0.9", "to at 1.5", "to the end"]


@pytest.mark.parametrize(
    "changes, text",
    [
        ({"program": [{"approach": 0.1}]}, "an approach leads to a path"),
        ({"program": [{"retract": 0.1}, SEAM]}, "a retract leads away from a path"),
        ({"program": [{"dwell": 0.1}]}, "nothing moves"),
        ({"program": [{"move": "next"}, {"move": "next"}, SEAM]}, "two moves meet"),
        ({"program": [SEAM], "task_space": "free"}, "a path needs a task space"),
        ({"program": [{"move": "nowhere"}]}, "this posture is not defined"),
        ({"program": [SEAM, {"move": "next"}], "order": "free"}, "cannot be free"),
        ({"program": [SEAM], "order": "free"}, "or leave out order, and add moves"),
        ({"program": [SEAM, {"payload": None}]}, "no motion follows this change"),
        ({"program": [{**SEAM, "events": [ARC, ARC]}]}, "seam: an event occurs twice"),
        ({"program": [{"dwell": -0.1}]}, "found -0.1; allowed: > 0, in s"),
        ({"scene": [{"box": [0.1, -0.8, 0.1]}]}, "found -0.8; allowed: > 0, in m"),
        (
            {"program": [{**SEAM, "events": [{"name": "arc", "lead": 50}]}]},
            "found 50; allowed: <= 10, in s",
        ),
        ({"program": [{**SEAM, "path_frame": "part"}]}, "frame"),
        (
            {
                "scene": [{"sphere": 0.1, "since": "dwell 1", "until": "retract 1"}],
                "collisions": {"mode": "avoid"},
            },
            r"scene\[0\].since: the arm does not move",
        ),
        ({"program": [{"paht": [], "name": "a"}]}, r"key paht; .* mean 'path'"),
        (
            {"program": [{"move": "next"}, {"approach": 0.1}, {"path": SEAM["path"]}]},
            r"program\[2\].path_start: this key is missing: .*convention$",
        ),
        ({"program": []}, "program: the program is empty"),
        ({"program": [SEAM, None]}, r"program\[1\]: a part needs .*; found null"),
        ({"program": [3]}, r"program\[0\]: a part needs exactly one kind; found 3"),
        (
            {"program": [{"move": {"joints": HOME}}], "start": "free"},
            "start: this key is missing",
        ),
        (
            {"program": [{**FAST, "move": "next"}, SEAM, {"move": "next"}]},
            "move 1: tool_limits.process_speed: a move has no path",
        ),
        (
            {"program": [{"move": "next", "velocity": 1.0}, SEAM]},
            r"belongs elsewhere: program\[0\].limits.velocity$",
        ),
        (
            {"program": [{"move": "next"}, {**SEAM, "tolerance": 0.01}]},
            r"program\[1\].tolerance: unknown key.*mean 'tolerances'",
        ),
        ({"program": [SEAM, {"wait": 0.1}]}, "key wait; .*dwell: 0.5"),
        ({"program": [[SEAM]]}, "Leave out the brackets"),
        (
            {"program": [SEAM["path"][0]]},
            r"keys line; .* belongs in path: write \{path: \{line: ...\}\}",
        ),
        (
            {"program": [{**SEAM, "path_begin": "free"}, {"retract": 0.1}]},
            r"program\[0\].path_begin: seam: a path that begins elsewhere",
        ),
        (
            {"program": [{"dwell": 0.1}, SEAM]},
            "dwell 1: the arm waits before it has moved; found a mapping with the keys dwell;",
        ),
        (
            {"program": [SEAM, {"move": "next"}], "end": "free"},
            r"program\[1\].move: move 1: the last move",
        ),
        (
            {"program": [{"move": "next"}, SEAM, {"move": {"joints": [0.1] * 7}}]},
            r"program\[2\].move: the last move leads to a posture other than the end",
        ),
    ],
)
def test_wrong_programs_are_refused(changes, text):
    with pytest.raises(TaskError, match=text):
        brachis.plan("iiwa14", **{**CYCLE, **changes})


@pytest.mark.parametrize(
    "program, text",
    [
        (
            [{"move": "next"}, SEAM],
            "end: the program does not lead back .*Add {move: next} as the last part",
        ),
        (
            [SEAM, {"move": {"joints": HOME}}],
            r"program\[0\]: seam: the start posture is off the path.*Put {move: next} before it",
        ),
        (
            [SEAM, {"move": {"joints": [0, 45, 0, -90, 0, 60, 0]}}],
            r"program\[1\].move.joints: .*45 deg are 0.785398 rad",
        ),
    ],
)
def test_wrong_postures_are_named_by_their_parts_with_advice_that_works(program, text):
    free = "free" if "45 deg" in text else HOME
    with pytest.raises(StartError, match=text):
        brachis.plan("iiwa14", **{**CYCLE, "start": free, "program": program})
    move = {"move": "next"}
    mended = [*program, move] if "Add" in text else [move, *program]
    if "45 deg" not in text:
        start = {"joints": HOME}
        content = {**CYCLE, "start": start, "program": mended}
        task = brachis.load_task({"brachis": 1, "robot": {"urdf": "iiwa14"}, **content})
        assert bind_task(robot_for(None, task.robot), task)


def test_degrees_of_a_last_move_are_refused_like_those_of_a_start():
    """Of a joint without a range, which may turn that far."""
    robot = brachis.Robot.from_urdf(brachis.robots.path_of("scara3"))
    free = {joint: [None, None] for joint in robot.joint_names}
    moves = [{"move": {"joints": [0, 45, 0]}}]
    with pytest.raises(PlausibilityError, match=r"program\[0\].move.joints.*degrees"):
        brachis.plan(
            "scara3",
            start=[0.0] * 3,
            program=moves,
            limits={"position": free},
            gravity=[0, 0, 0],
        )


@pytest.mark.parametrize("part, name", [("approach", 1), ("retract", 1)])
def test_an_approach_out_of_reach_is_named(part, name):
    sides = [[{"move": "next"}], [{"move": {"joints": HOME}}]]
    sides[part == "retract"].insert(-1 if part == "retract" else 1, {part: 1.2})
    program = [*sides[0], SEAM, *sides[1]]
    with pytest.raises(PathError, match=f"program: {part} {name}: path, s in"):
        brachis.plan("iiwa14", **{**CYCLE, "program": program})


def test_a_blocked_move_is_named(monkeypatch):
    def blocked(*_):
        raise PathError("no way", where="task_space: free")

    monkeypatch.setattr("brachis.search.chain.move_guesses", blocked)
    with pytest.raises(PathError, match=r"^program: move 1: no way"):
        brachis.plan(GANTRY_CYCLE)


def test_segments_in_place_of_parts_are_explained():
    line = brachis.Line(by=[0.0, 0.3])
    for segments in (line, [line]):
        with pytest.raises(TaskError, match=r"found Line\(by=.*write {path: {line"):
            brachis.Program(segments)
    assert brachis.Program({"path": {"line": {"by": [0.0, 0.3]}}})[0].path == (line,)


def test_parts_without_names_are_numbered_by_kind():
    names = part_names(
        brachis.Program([SEAM, {"dwell": 1}, SEAM | {"name": None}, {"dwell": 1}])
    )
    assert names == ["seam", "dwell 1", "path 2", "dwell 2"]


def test_keys_of_segments_are_those_of_the_part():
    """Its approach is the first segment of the path that is planned."""
    line = {"line": {"by": [0.1, 0.0, 0.0]}}
    paths = [SEAM, {"path": [{**line, "blend": 9.0}, line]}]
    program = [{"move": "next"}, {"approach": 0.05}, *paths, {"move": "next"}]
    with pytest.raises(PathError, match=r"program\[3\].path\[0\].blend"):
        brachis.plan("iiwa14", **{**CYCLE, "program": program})


def test_a_move_from_nowhere_is_refused():
    with pytest.raises(TaskError, match="start: this key is missing"):
        brachis.plan("iiwa14", **{**CYCLE, "start": "free", "end": "free"})


@pytest.mark.parametrize(
    "y, text",
    [
        (2.5, "m away from the robot's first joint"),
        (0.75, "out of reach from s = 0 on"),
    ],
)
def test_a_seam_out_of_reach_is_named_and_explained_like_a_single_path(
    y, text, monkeypatch
):
    if y == 2.5:
        # No path is searched.
        monkeypatch.setattr("brachis.search.chain.joint_paths_in_charts", None)
        monkeypatch.setattr("brachis.search.chain.batches", None)
    path_start = {"position": [0.5, y, 0.4], "rpy_deg": [180, 0, 0]}
    far = {**SEAM, "path": [{"line": {"by": [0, 0.2, 0]}}], "path_start": path_start}
    program = [{"move": "next"}, SEAM, {"move": "next"}, {**far, "name": "far"}]
    with pytest.raises(PathError, match=text) as error:
        brachis.plan("iiwa14", **{**CYCLE, "end": "free", "program": program})
    assert "program: far: path, s in [0, 1]" in str(error.value)
    assert error.value.hint


def test_events_outside_the_motion_are_told(slide):
    early = {"name": "arc_on", "lead": 0.02}
    late = {"name": "arc_off", "at": "end", "lead": -0.01}
    moves = [
        {"move": {"joints": [0.5]}, "events": [early]},
        {"move": {"joints": [0.7]}, "events": [late, {**early, "name": "gas_on"}]},
    ]
    with pytest.warns(PlausibilityWarning, match="not during the motion"):
        result = plan_slide(slide, moves, start=[0.0], strict=True)
    (issue,) = result.warnings
    late_time = f"{result.t_end + 0.01:.4f}"
    assert issue.found == f"arc_on -0.0200 s, arc_off {late_time} s"


@pytest.mark.parametrize("profile", [None, "kuka_rsi_4ms"])
def test_events_outside_the_motion_are_not_exported(slide, profile, tmp_path):
    early = {"name": "process_on", "lead": 0.02}
    move = {"move": {"joints": [0.5]}, "events": [early]}
    with pytest.warns(PlausibilityWarning, match="add a move before"):
        result = plan_slide(slide, [move], start=[0.0])
    match = "events.process_on: .*found -0.0200 s; .*change its lead"
    write = brachis.export.write
    path = tmp_path / "motion.csv"
    if profile is not None:
        write = partial(brachis.export.write_for_controller, profile=profile)
        path = tmp_path / "motion.src"
    with pytest.raises(InputError, match=match):
        write(result, path)
