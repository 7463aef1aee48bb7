# SPDX-License-Identifier: GPL-2.0-or-later
"""Every message goes over a bus and into a log and comes back with the same bits, and what breaks a rule does not."""
import copy
import pickle
import threading
import time

import numpy as np
import pytest

import angio


def filled(kind, seed):
    """A message with a value of its own in every field, within the rules of the wire."""
    random = np.random.default_rng(seed)
    if kind is angio.XrayFrame:
        image = random.integers(0, 65535, (6, 8), dtype=np.uint16)
        return angio.XrayFrame(image, angio.XrayCamera(8, 6, 900.5, 901.25, 3.5, 2.5, pixel_spacing_m=2e-4), time_us=7, sequence=3)
    message = kind()
    for name in sorted(vars(kind)):
        if not isinstance(vars(kind)[name], property):
            continue
        old = getattr(message, name)
        if hasattr(type(old), "__members__"):
            setattr(message, name, list(type(old).__members__.values())[-1])
        elif type(old) in angio.MESSAGES:
            setattr(message, name, filled(type(old), seed + 1))
            assert getattr(message, name) != type(old)()
        elif name == "T_camera_model":
            setattr(message, name, angio.exp_se3(random.normal(size=6)))
        elif kind is angio.RegistrationPoints and name == "covariance":
            setattr(message, name, random.random((4, 6), dtype=np.float32))
        elif isinstance(old, np.ndarray):
            setattr(message, name, random.random(old.shape))
        elif isinstance(old, int):
            setattr(message, name, int(random.integers(1, 100)))
        elif isinstance(old, float):
            setattr(message, name, float(random.random()))
        elif isinstance(old, str):
            setattr(message, name, f"text {seed}")
    return message


CHANNELS = sorted(angio.CHANNELS.items())


def test_every_type_has_a_channel():
    assert set(angio.CHANNELS.values()) == set(angio.MESSAGES)


@pytest.mark.parametrize("channel, kind", CHANNELS)
def test_round_trip(channel, kind):
    sent = filled(kind, sum(map(ord, channel)))
    bus, heard = angio.Bus("memq://"), []
    bus.subscribe(channel, heard.append)
    bus.publish(channel, sent)
    assert bus.handle(1) == 1 and heard == [sent] and heard[0].encode() == sent.encode()
    assert kind.decode(sent.encode()) == sent == pickle.loads(pickle.dumps(sent)) == copy.deepcopy(sent)
    # Field by field too: encode() might leave one out on both sides.
    for name in (n for n, member in vars(kind).items() if isinstance(member, property) and n not in ("camera",)):
        assert np.array_equal(getattr(heard[0], name), getattr(sent, name)), name


def test_rules_hold():
    bus = angio.Bus("memq://")
    with pytest.raises(angio.InputError, match=r"joint_velocity\[2\] = nan: must be finite"):
        bus.publish("CARM_COMMAND", angio.CArmCommand(velocity=[0, 0, np.nan, 0, 0]))
    with pytest.raises(angio.InputError, match="must be a CArmCommand"):
        bus.publish("CARM_COMMAND", angio.CArmState())
    with pytest.raises(TypeError):
        bus.publish("CARM_COMMAND", "go")
    with pytest.raises(TypeError, match="has no field 'speed'"):
        angio.CArmCommand(speed=1)
    heard, refused = [], []
    bus.subscribe("CARM_COMMAND", heard.append, refused.append)
    bus.publish("CARM_COMMAND", angio.CArmState().encode())  # Bytes are not looked at when they are sent.
    bus.publish("CARM_COMMAND", b"rubbish")
    bus.publish("CARM_COMMAND", angio.CArmCommand(sequence=1))
    bus.handle(1)
    assert len(heard) == 1 and len(refused) == 2 and "must be a CArmCommand" in refused[0]


def test_latest_message_keeps_the_newest():
    bus = angio.Bus("memq://")
    box = angio.LatestMessage(bus, "CARM_STATE")
    for sequence in (1, 3, 2):
        bus.publish("CARM_STATE", angio.CArmState(sequence=sequence, time_us=sequence))
    bus.publish("CARM_STATE", b"rubbish")
    bus.handle(1)
    assert box.take().sequence == 3 and box.take() is None
    assert (box.received, box.dropped, box.refused) == (4, 1, 1) and box.last_error


def test_what_a_handler_throws_comes_out():
    bus = angio.Bus("memq://")

    def handler(message):
        raise RuntimeError("mine")

    bus.subscribe("CARM_STATE", handler)
    bus.publish("CARM_STATE", angio.CArmState())
    with pytest.raises(RuntimeError, match="mine"):
        bus.handle(1)


def test_other_threads_run_while_a_bus_waits():
    bus, ticks = angio.Bus("memq://"), []
    waits = threading.Thread(target=bus.handle, args=(0.5,))
    waits.start()
    while waits.is_alive():
        ticks.append(time.monotonic())
        time.sleep(0.01)
    waits.join()
    assert len(ticks) > 5  # With the lock held there would be one.


def test_a_log_is_written_and_read(tmp_path):
    path = str(tmp_path / "log.lcm")
    sent = [(channel, filled(kind, i)) for i, (channel, kind) in enumerate(CHANNELS)]
    with angio.LogWriter(path) as log:
        for channel, message in sent:
            log.write(channel, message)
    assert [(event.channel, event.message()) for event in angio.LogReader(path)] == sent
    with open(path, "r+b") as file:  # What is damaged is passed over.
        file.truncate(angio.LogReader(path).size_bytes - 3)
    log = angio.LogReader(path)
    assert len(list(log)) == len(sent) - 1 and log.skipped_bytes > 0
    # A bus reads it too, a message a call.
    bus, heard = angio.Bus(f"file://{path}?speed=0"), []
    bus.subscribe("CARM_STATE", heard.append)
    while not bus.ended:
        bus.handle(1)
    assert heard == [message for channel, message in sent if channel == "CARM_STATE"]


def test_programs_hear_the_module_over_the_network(programs, tmp_path):
    import json
    import os
    import subprocess

    url = f"udpm://239.255.76.67:{20000 + os.getpid() % 20000}?ttl=0"
    try:
        bus = angio.Bus(url)
        bus.publish("CARM_STATE", angio.CArmState())
    except (angio.InputError, RuntimeError) as error:
        pytest.skip(f"no multicast: {error}")
    spy = subprocess.Popen([str(programs / "angio-spy"), "--bus", url, "--once", "--duration-s", "1.5", "--json", str(tmp_path / "spy.json")],
                           stdout=subprocess.DEVNULL)
    sequence = 0
    while spy.poll() is None:
        sequence += 1
        bus.publish("CARM_STATE", angio.CArmState(time_us=sequence, sequence=sequence, joints=[0.1, 0, 0, 0, 0]))
        time.sleep(0.02)
    state = json.loads((tmp_path / "spy.json").read_text())["channels"]["CARM_STATE"]
    assert state["messages"] > 5 and state["undecodable"] == 0 and state["missing"] == 0, state
    assert state["last_value"].startswith("+5.73"), state
