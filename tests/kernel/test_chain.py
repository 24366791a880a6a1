"""The kernel against Pinocchio, on random chains of revolute and prismatic joints."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

from brachis.kernel import rotation_vectors
from brachis.robot.chain import chain_of
from support.random_chains import random_model

STATES = 11  # not a multiple of what is computed side by side


def agrees(found, known):
    scale = max(np.abs(known).max(), 1.0)
    return bool(np.abs(found - known).max() < 1e-11 * scale)


@pytest.fixture(params=[(n, seed) for n in range(1, 11) for seed in range(3)], ids=str)
def case(request):
    n, seed = request.param
    pin.seed(seed)
    model, frame = random_model(n, seed)
    rng = np.random.default_rng(100 + seed)
    states = rng.normal(0.0, 2.0, (3, STATES, n))
    return model, frame, chain_of(model, frame), states


def test_torques(case):
    model, _, chain, (q, qdot, qddot) = case
    data = model.createData()
    states = zip(q, qdot, qddot, strict=True)
    known = [pin.rnea(model, data, *state) for state in states]
    assert agrees(chain.torques(q, qdot, qddot), np.array(known))


def test_torque_derivatives(case):
    model, _, chain, (q, qdot, qddot) = case
    data = model.createData()
    found = chain.torque_derivatives(q, qdot, qddot)
    for k in range(STATES):
        known = pin.computeRNEADerivatives(model, data, q[k], qdot[k], qddot[k])
        by_q, by_qdot, matrix = (np.array(part) for part in known)
        upper = np.triu(matrix)
        for own, other in zip(
            found, (by_q, by_qdot, upper + np.triu(matrix, 1).T), strict=True
        ):
            assert agrees(own[k], other)


def test_mass_matrices(case):
    model, _, chain, (q, *_) = case
    data = model.createData()
    for matrix, posture in zip(chain.mass_matrices(q), q, strict=True):
        upper = np.triu(pin.crba(model, data, posture))
        assert agrees(matrix, upper + np.triu(upper, 1).T)


def test_rotors_and_friction(case):
    model, frame, bare, (q, qdot, qddot) = case
    table = np.random.default_rng(7).uniform(0.1, 3.0, (bare.n, 4))
    table[0, 2] = 0.0  # no Coulomb friction
    armature, viscous, coulomb, speed = table.T
    chain = chain_of(model, frame, table)
    own = armature * qddot + viscous * qdot + coulomb * np.tanh(qdot / speed)
    assert agrees(chain.torques(q, qdot, qddot), bare.torques(q, qdot, qddot) + own)
    slope = viscous + coulomb / speed / np.cosh(qdot / speed) ** 2
    diagonal = np.eye(bare.n)
    more = (0.0, slope[:, None] * diagonal, armature * diagonal)
    parts = zip(
        chain.torque_derivatives(q, qdot, qddot),
        bare.torque_derivatives(q, qdot, qddot),
        more,
        strict=True,
    )
    for found, rigid, added in parts:
        assert agrees(found, rigid + added)
    assert agrees(chain.mass_matrices(q), bare.mass_matrices(q) + armature * diagonal)


@pytest.mark.parametrize("in_tool_axes", [True, False])
def test_tool(case, in_tool_axes):
    model, frame, chain, (q, *_) = case
    axes = pin.LOCAL if in_tool_axes else pin.LOCAL_WORLD_ALIGNED
    data = model.createData()
    positions, rotations, twists = chain.tool(q, in_tool_axes=in_tool_axes)
    for k in range(STATES):
        columns = pin.computeFrameJacobian(model, data, q[k], frame, axes)
        pin.framesForwardKinematics(model, data, q[k])
        assert agrees(positions[k], data.oMf[frame].translation)
        assert agrees(rotations[k], data.oMf[frame].rotation)
        assert agrees(twists[:, k], columns.reshape(6, -1))


QUANTITIES = {
    "speed": lambda model, data, *at: pin.getFrameVelocity(model, data, *at).linear,
    "angular speed": lambda model, data, *at: (
        pin.getFrameVelocity(model, data, *at).angular
    ),
    "acceleration": lambda model, data, *at: (
        pin.getFrameClassicalAcceleration(model, data, *at).linear
    ),
}


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_tool_sizes(case, quantity):
    """Sizes by Pinocchio's frame motion, slopes by its differences."""
    model, frame, chain, states = case
    data = model.createData()

    def size(q, qdot, qddot):
        pin.forwardKinematics(model, data, q, qdot, qddot)
        at = (frame, pin.LOCAL_WORLD_ALIGNED)
        return np.linalg.norm(QUANTITIES[quantity](model, data, *at))

    rest = [states[0], 0.0 * states[1], 0.0 * states[2]]
    at_rest, at_rest_slopes = chain.tool_size_slopes(quantity, *rest)
    assert not at_rest.any() and not np.any(at_rest_slopes)
    sizes, slopes = chain.tool_size_slopes(quantity, *states)
    assert np.array_equal(sizes, chain.tool_sizes(quantity, *states))
    h = 1e-6
    for k in range(STATES):
        here = [own[k] for own in states]
        assert agrees(sizes[k], size(*here))
        if sizes[k] < 1e-9:  # only prismatic joints
            continue
        for number, own in enumerate(slopes):
            for joint, step in enumerate(h * np.eye(chain.n)):
                ahead, behind = list(here), list(here)
                ahead[number] = here[number] + step
                behind[number] = here[number] - step
                known = (size(*ahead) - size(*behind)) / (2.0 * h)
                assert own[k, joint] == pytest.approx(known, abs=1e-6 * (1 + sizes[k]))


def test_no_states(case):
    _, _, chain, _ = case
    none = np.empty((0, chain.n))
    assert chain.torques(none, none, none).shape == (0, chain.n)
    assert chain.tool(none, in_tool_axes=True)[2].shape == (6, 0, chain.n)
    assert chain.tool_sizes("speed", none, none, none).shape == (0,)


def test_odd_arrays_are_read_as_they_are(case):
    chain, (q, qdot, qddot) = case[2], case[3]
    known = chain.torques(q, qdot, qddot)
    columns = np.asfortranarray(q)
    every_second = np.repeat(qdot, 2, axis=1)[:, ::2]
    assert np.array_equal(chain.torques(columns, every_second, qddot), known)


def test_what_is_not_finite_stays_in_its_state(case):
    chain, (q, qdot, qddot) = case[2], case[3].copy()
    known = chain.torques(q, qdot, qddot)
    qdot[3] = np.nan
    found = chain.torques(q, qdot, qddot)
    assert np.isnan(found[3]).any()
    assert np.array_equal(np.delete(found, 3, 0), np.delete(known, 3, 0))


def test_a_chain_survives_pickling(case):
    chain, (q, qdot, qddot) = case[2], case[3]
    known = chain.torques(q, qdot, qddot)
    again = pickle.loads(pickle.dumps(chain))  # noqa: S301
    assert np.array_equal(again.torques(q, qdot, qddot), known)


def test_rotation_vectors():
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(400, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    angles = np.concatenate(
        [
            rng.uniform(0.0, np.pi, 200),
            10.0 ** rng.uniform(-16, 0, 100),
            np.pi - 10.0 ** rng.uniform(-12, 0, 100),
        ]
    )
    vectors = axes * angles[:, None]
    rotations = np.array([pin.exp3(vector) for vector in vectors])
    found = rotation_vectors(rotations)
    # Half a turn about an axis is one about the opposite axis, too.
    is_half = angles > np.pi - 1e-7
    signs = np.sign(np.sum(found * vectors, axis=1))[:, None]
    assert np.abs(found - vectors)[~is_half].max() < 1e-13
    assert np.abs(found * signs - vectors)[is_half].max() < 1e-13


def test_no_rotation_is_no_vector():
    assert np.array_equal(rotation_vectors(np.eye(3)[None]), np.zeros((1, 3)))


def test_arrays_of_another_shape_are_errors(case):
    chain, (q, qdot, qddot) = case[2], case[3]
    with pytest.raises(ValueError, match="an array has the shape"):
        chain.torques(q[:, :1].repeat(chain.n + 1, axis=1), qdot, qddot)
    with pytest.raises(ValueError, match="an array has the shape"):
        chain.torques(q, qdot[:3], qddot)
