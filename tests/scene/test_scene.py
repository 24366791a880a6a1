"""Distances of a scene against formulas, Pinocchio and MuJoCo; bounds; which pairs there are."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.errors import InputError, StartError
from brachis.limits import Moments
from brachis.limits.clearance import build_clearance
from brachis.robot.from_task import robot_for
from brachis.scene import UNIT, scene_of
from brachis.scene.chain import Chain
from brachis.verify.mechanics import joint_placements
from support.mujoco_models import mujoco_model

ROBOTS = Path(__file__).parents[2] / "robots"
BODIES = yaml.safe_load("""
- name: box
  box: [0.2, 0.3, 0.4]
  position: [0.5, 0.1, 0.6]
- name: ball
  sphere: 0.1
  position: [-0.3, 0.4, 0.5]
- name: floor
  half_space:
    normal: [0, 0, 2]
    offset: -0.5
- name: rod
  capsule: {radius: 0.05, length: 0.3}
  position: [0.2, -0.5, 0.4]
  rpy_deg: [90, 20, 0]
- name: drum
  cylinder: {radius: 0.1, length: 0.3}
  position: [0.2, 0.5, 0.9]
  rpy_deg: [30, 60, 10]
""")
NAMES = ("iiwa14", "tx90l_rail", "ur10_rail", "gen3_rails", "arm8", "scara3")


def task(name="iiwa14", scene=BODIES, mounting="floor", **collisions):
    urdf = ROBOTS / name / "robot.urdf"
    n = brachis.Robot.from_urdf(urdf).n
    return brachis.load_task(
        {
            "brachis": 1,
            "robot": {"urdf": str(urdf), "mounting": mounting},
            "start": {"joints": [0.0] * n},
            "task_space": "position",
            "path": [{"line": {"to": [0, 0, 0]}}],
            "scene": scene,
            "collisions": collisions,
        }
    )


def scene(name="iiwa14", bodies=BODIES, **collisions):
    robot, given = robot_and_task(name, bodies, **collisions)
    return robot, scene_of(robot, given)


def robot_and_task(*arguments, **options):
    given = task(*arguments, **options)
    return robot_for(None, given.robot), given


def build_limit(name="iiwa14"):
    """The limit, and postures of its robot."""
    robot, given = robot_and_task(name)
    return build_clearance(robot, given), postures(robot)


def pair_names(found):
    return [found.names(pair) for pair in range(len(found.pairs))]


def postures(robot, count=40):
    return np.random.default_rng(1).uniform(-1.5, 1.5, (count, robot.n))


def place(robot, count=40):
    return Chain.of(robot.model).place(postures(robot, count))


def everything(found, placed):
    """All pairs in all postures."""
    posture, pair = np.indices((len(placed[0]), len(found.pairs)))
    return found.measure(placed, posture.ravel(), pair.ravel())


@pytest.mark.parametrize("name", NAMES)
def test_joints_and_solids_stand_where_pinocchio_and_the_text_say(name):
    mounting = {"xyz": [0.1, 0.2, 0.3], "rpy_deg": [5, 6, 7]}
    robot, given = robot_and_task(name, mounting=mounting)
    q = postures(robot)
    placed = Chain.of(robot.model).place(q)
    for k, data in enumerate(robot.place_joints(q)):
        for joint, placement in enumerate(data.oMi):
            assert_allclose(placed[0][k, joint], placement.rotation, atol=1e-12)
            assert_allclose(placed[1][k, joint], placement.translation, atol=1e-12)
    for mine, other in zip(placed, joint_placements(robot, q), strict=True):
        assert_allclose(mine, other, atol=1e-12)
    found = scene_of(robot, given)
    for solid, joint, placed in zip(
        found.solids, found.joints, found.placements, strict=True
    ):
        if solid.link is not None:
            frame = robot.model.frames[robot.model.getFrameId(solid.link)]
            expected = frame.placement.homogeneous @ solid.placement
            assert joint == frame.parentJoint
            assert_allclose(placed, expected, atol=1e-12)


def test_distances_of_balls_and_planes_are_those_of_formulas():
    bodies = yaml.safe_load("""
    - {name: ball, sphere: 0.1, position: [0.5, 0.3, 0.7]}
    - {name: held, sphere: 0.05, link: tool, position: [0, 0, 0.2]}
    - {name: floor, half_space: {normal: [0, 0, 2], offset: 0.2}}
    """)
    robot, found = scene(bodies=bodies)
    position, turned = robot.tool_placements(postures(robot))
    held = position + turned @ [0.0, 0.0, 0.2]
    near = everything(found, place(robot))
    names = [found.names(pair) for pair in near.pair]
    apart = {
        "ball and held": np.linalg.norm(held - [0.5, 0.3, 0.7], axis=1) - 0.15,
        "held and floor": held[:, 2] - 0.2 - 0.05,
    }
    for pair, expected in apart.items():
        own = [each == pair for each in names]
        assert_allclose(near.distance[own], expected, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_no_bound_is_above_the_distance(name):
    robot, found = scene(name)
    placed = place(robot)
    near = everything(found, placed)
    bounds = found.bounds(placed)[near.posture, near.pair]
    assert np.all(bounds <= near.distance + 1e-6)
    for within in (0.0, 0.1, 0.5):
        few = found.find_close(placed, within)
        assert len(few.pair) == np.count_nonzero(near.distance < within)
        assert np.all(few.distance < within)


@pytest.mark.parametrize("name", ["iiwa14", "tx90l_rail", "gen3_rails"])
def test_mujoco_finds_the_same_distances(name):
    mujoco = pytest.importorskip("mujoco")
    robot, found = scene(name, [{"name": "far", "sphere": 0.1, "position": [9, 9, 9]}])
    model, order = mujoco_model(robot)
    data = mujoco.MjData(model)
    q = postures(robot, 10)
    near = everything(found, place(robot, 10))
    geoms = {}
    for geom in range(model.ngeom):
        link = model.body(model.geom_bodyid[geom]).name
        geoms.setdefault(link, []).append(geom)
    checked = 0
    for k, posture in enumerate(q):
        data.qpos[order] = posture
        mujoco.mj_forward(model, data)
        for pair, distance in zip(
            near.pair[near.posture == k], near.distance[near.posture == k], strict=True
        ):
            solids = [found.solids[i] for i in found.pairs[pair]]
            links = [geoms.get(solid.link or "", []) for solid in solids]
            if any(len(own) != 1 for own in links) or distance < 0.01:
                continue
            other = mujoco.mj_geomDistance(
                model, data, links[0][0], links[1][0], 5.0, None
            )
            assert distance == pytest.approx(other, abs=2e-5)
            checked += 1
    assert checked > 5


@pytest.mark.parametrize("name", NAMES)
def test_slopes_agree_with_differences(name):
    limit, q = build_limit(name)
    values = limit.values(Moments.at_rest(q))
    exact = limit.partials(Moments.at_rest(q)).q
    step = 1e-5
    for joint, move in enumerate(step * np.eye(q.shape[1])):
        moved = [limit.values(Moments.at_rest(q + sign * move)) for sign in (1.0, -1.0)]
        far = values.max() - 1e-9
        is_near = (values > 0.0) & (values < far) & (moved[0] < far) & (moved[1] < far)
        slopes = (moved[0] - moved[1]) / (2.0 * step)
        off = np.abs(slopes - exact[:, :, joint])[is_near] * UNIT
        # Coal's nearest points are exact to about 1e-5 m.
        assert off.max(initial=0.0) < 1e-4
        assert np.count_nonzero(off > 1e-5) <= 0.05 * len(off)


def test_links_that_meet_or_always_touch_are_no_pairs():
    robot, found = scene()
    links = {
        frozenset(found.solids[i].link for i in pair)
        for pair in found.pairs
        if all(found.solids[i].link for i in pair)
    }
    assert frozenset({"link_2", "link_5"}) in links
    assert frozenset({"link_3", "link_4"}) not in links
    near = everything(found, place(robot, 300))
    touching = np.bincount(near.pair[near.distance < 0.0], minlength=len(found.pairs))
    assert touching.max() < 300


def test_pairs_are_disabled_by_link_and_by_name():
    _, found = scene()
    _, fewer = scene(disable=[["link_2", "link_5"], ["ball", "link_7"]])
    assert {*pair_names(found)} - {*pair_names(fewer)} == {
        "link_2 and link_5 0",
        "link_2 and link_5 1",
        "link_7 and ball",
    }
    _, alone = scene(self_collision=False)
    assert all(any(alone.solids[i].link is None for i in pair) for pair in alone.pairs)


def test_padding_makes_links_larger():
    robot, found = scene()
    _, padded = scene(padding={"link_6": 0.02})
    placed = place(robot, 5)
    remaining = everything(padded, placed).distance
    apart = everything(found, placed).distance - remaining
    own = np.array(["link_6" in pair for pair in pair_names(found)] * 5)
    is_apart = remaining > 0.0
    assert_allclose(apart[own & is_apart], 0.02, atol=1e-8)
    assert_allclose(apart[~own], 0.0, atol=1e-8)


def test_padded_balls_are_found_from_as_far_away_as_they_are_large(tmp_path):
    text = (ROBOTS / "iiwa14/robot.urdf").read_text()
    begin = text.index("<collision>", text.index('<link name="link_7">'))
    end = text.index("</geometry>", begin)
    shape = text.index("<cylinder", begin)
    assert shape < end
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(text[:shape] + '<sphere radius="0.05"/>' + text[end:])
    robot = brachis.Robot.from_urdf(urdf)
    found = scene_of(robot, task(padding={"link_7": 0.3}))
    placed = place(robot)
    near = everything(found, placed)
    is_close = near.distance < 0.2
    assert len(found.find_close(placed, 0.2).pair) == np.count_nonzero(is_close)
    bounds = found.bounds(placed)[near.posture, near.pair]
    assert np.all(bounds <= near.distance + 1e-6)


def test_every_posture_has_its_closest_pair():
    robot, found = scene()
    placed = place(robot)
    every = everything(found, placed)
    closest = found.find_closest(placed)
    assert_array_equal(closest.posture, np.arange(40))
    for k in range(40):
        least = every.distance[every.posture == k].min()
        assert closest.distance[k] == pytest.approx(least, abs=1e-12)


def test_the_limit_has_only_pairs_that_come_close():
    limit, q = build_limit()
    kept = limit.restrict_to(q)
    assert 0 < len(kept.lower) < len(limit.lower)
    assert_allclose(kept.lower * UNIT, 0.01)
    assert limit.restrict_to(q[:0]) is None


def test_a_limit_keeps_inside_its_bounds_as_far_as_both_ends_do():
    limit, q = build_limit()
    distances = limit.values(Moments.at_rest(q))
    apart = np.argmax(distances.min(axis=1))
    added = limit.keep_inside(q[[apart]]).lower - limit.lower
    room = distances[apart] - limit.lower
    assert_allclose(added, np.clip(room, 0.0, limit.inset), atol=1e-12)
    close = np.argmin(distances.min(axis=1))
    column = np.argmin(distances[close])
    assert distances[close, column] < limit.lower[column]
    narrower = limit.keep_inside(q[[apart, close]])
    assert narrower.lower[column] == limit.lower[column]
    assert added.max() == pytest.approx(limit.inset)


@pytest.mark.parametrize(
    "body, message",
    [
        ("{box: [1, 1, 1], sphere: 1.0}", "exactly one shape"),
        ("name: post", "exactly one shape"),
        ("box: [1, 1]", "box"),
        ("sphere: -1.0", "sphere"),
        ("half_space: {normal: [0, 0, 0]}", "cannot have zero length"),
        ("{half_space: {normal: [0, 0, 1]}, link: tool}", "fixed to the world"),
        ("{sphere: 1.0, link: tol}", "tool"),
        (
            "{half_space: {normal: [0, 0, 1]}, position: [0, 0, 1]}",
            "given only by its plane",
        ),
        ("mesh: missing.stl", "missing.stl"),
    ],
)
def test_the_error_says_what_is_wrong_with_a_body(body, message):
    with pytest.raises(InputError, match=message):
        scene(bodies=[yaml.safe_load(body)])


def test_names_of_bodies_are_unique_and_links_exist():
    twice = [{"name": "a", "sphere": 0.1}, {"name": "a", "sphere": 0.2}]
    with pytest.raises(InputError, match="two bodies have the same name"):
        scene(bodies=twice)
    for wrong in ({"padding": {"link_66": 0.1}}, {"disable": [["link_66", "ball"]]}):
        with pytest.raises(InputError, match="link_6"):
            scene(**wrong)


def test_a_link_that_is_disabled_does_not_free_what_it_holds():
    held = {"name": "torch", "sphere": 0.05, "link": "link_7", "position": [0, 0, 0.2]}
    _, found = scene(bodies=[held, BODIES[0]], disable=[["link_7", "box"]])
    names = pair_names(found)
    assert "torch and box" in names
    assert "link_7 and box" not in names


def test_a_body_that_is_always_hit_stays():
    """Only the robot's own links that always touch are left out."""
    stand = {"name": "stand", "box": [0.5, 0.5, 0.8], "position": [0, 0, 0.4]}
    _, found = scene(bodies=[stand])
    names = pair_names(found)
    assert "link_1 0 and stand" in names
    assert "link_0 and stand" not in names


@pytest.mark.parametrize(
    "shape",
    [
        '<box size="1 1"/>',
        "<sphere/>",
        '<cylinder radius="1"/>',
        '<sphere radius="-1"/>',
    ],
)
def test_wrong_collision_geometry_is_an_error(shape, tmp_path):
    text = (ROBOTS / "iiwa14/robot.urdf").read_text()
    first = '<cylinder radius="0.1" length="0.1575"/>'
    begin = text.index("<collision>")
    assert text.index(first, begin) < text.index("</collision>", begin)
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(text[:begin] + text[begin:].replace(first, shape, 1))
    with pytest.raises(InputError, match="collision geometry cannot be read"):
        scene_of(brachis.Robot.from_urdf(urdf), task())


def test_a_robot_without_collision_geometry_is_refused_or_gets_capsules(tmp_path):
    urdf = tmp_path / "robot.urdf"
    text = (ROBOTS / "iiwa14/robot.urdf").read_text()
    urdf.write_text(text.replace("collision>", "other>"))
    given = task()
    robot = brachis.Robot.from_urdf(urdf)
    with pytest.raises(InputError, match="capsules: auto"):
        scene_of(robot, given)
    given = task(capsules="auto")
    found = scene_of(robot, given)
    assert {type(solid.geometry).__name__ for solid in found.solids[:7]} == {"Capsule"}
    data = next(iter(robot.place_joints(np.zeros((1, 7)))))
    (first,) = (solid for solid in found.solids if solid.link == "link_2")
    joint = pin.SE3(first.placement)
    middle = data.oMi[2].act(joint.translation)
    ends = data.oMi[2].translation, data.oMi[3].translation
    assert_allclose(middle, 0.5 * (ends[0] + ends[1]), atol=1e-9)


def test_an_error_names_the_first_pairs_that_are_too_close():
    with pytest.raises(StartError, match="clearance limit") as caught:
        brachis.plan(
            "iiwa14",
            start=[0.3, 0.6, 0.2, -1.2, 0.1, 0.8, 0.1],
            path=[{"line": {"by": [0, 0.1, 0]}}],
            task_space="pose",
            scene=[{"name": "b", "box": [1, 1, 1], "position": [0.3, 0, 0.5]}],
            collisions={"clearance": 0.3},
        )
    assert len(str(caught.value)) < 500
    _, others = str(caught.value.found).split("likewise ")
    assert re.search(r"^[^,]+, [^,]+, [^,]+ and \d+ more$", others)
