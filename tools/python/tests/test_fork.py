"""A forked process answers or raises; it never waits for threads that its parent has."""

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
from conftest import smooth

import wavesplat

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of forks beside threads
SECONDS = 60


def forked(work):
    """What ``work`` returns or raises in a forked process: a text."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            answer = str(work())
        except BaseException as error:
            answer = f"{type(error).__name__}: {error}"
        os.write(writer, answer.encode()[:4000])
        os._exit(0)
    os.close(writer)
    ended = wait(child)
    with os.fdopen(reader) as answers:
        assert ended, "the forked process hangs"
        return answers.read()


def wait(child):
    """Whether a process ends in time; it is killed otherwise."""
    for _ in range(SECONDS * 20):
        if os.waitpid(child, os.WNOHANG)[0]:
            return True
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


@pytest.fixture
def used(path):
    """A file whose blocks are decoded already by the threads of this process."""
    file = wavesplat.open(path)
    file[...]
    return file


def test_an_open_file_is_read(used, decoded):
    assert forked(lambda: np.array_equal(used[3:19, ::2], decoded[3:19, ::2])) == "True"
    assert forked(lambda: np.array_equal(used[...], decoded)) == "True"
    np.testing.assert_array_equal(used[...], decoded)


def test_a_file_is_opened_checked_and_drawn(used, path):
    def work():
        with wavesplat.open(path) as file:
            file.check()
            return file.render(frames=3, size=(32, 32)).shape

    assert forked(work) == "(1, 32, 32)"


def test_threads_of_a_forked_process_take_turns(used, decoded):
    def work():
        found = []
        threads = [threading.Thread(target=lambda n=n: found.append((n, used[n]))) for n in range(8)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        return all(np.array_equal(frame, decoded[n]) for n, frame in found) and len(found)

    assert forked(work) == "8"


def test_a_forked_process_may_fork(used, decoded):
    assert forked(lambda: (used[0].shape, forked(lambda: np.array_equal(used[5], decoded[5])))[1]) == "True"


def test_conversions_raise_and_say_what_helps(used, tmp_path):
    said = forked(lambda: wavesplat.convert(smooth(), tmp_path / "a.wspl"))
    assert said.startswith("RuntimeError")
    assert 'set_start_method("spawn")' in said
    assert os.listdir(tmp_path) == []


def test_a_fork_amid_work_of_another_thread_raises(path, tmp_path):
    begun, go_on = threading.Event(), threading.Event()

    def frames():
        yield smooth()[0]
        begun.set()
        go_on.wait(SECONDS)

    worker = threading.Thread(target=wavesplat.convert, args=(frames(), tmp_path / "a.wspl"))
    worker.start()
    begun.wait(SECONDS)
    said = forked(lambda: wavesplat.open(path)[0].shape)
    go_on.set()
    worker.join()
    assert "RuntimeError" in said
    assert "spawn" in said
    assert wavesplat.open(path)[0].shape == (20, 18, 22)


def test_a_viewer_of_the_parent_is_left_alone(used):
    with used.view(browser=False) as viewer:
        assert "spawn" in forked(lambda: used[0])
        assert forked(viewer.close) == "None"
    assert forked(lambda: used[0].shape) == "(20, 18, 22)"


def shape(file):
    return file[2].shape


def test_pools_of_processes_read(used, path):
    fork = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(2, mp_context=fork) as pool:
        assert list(pool.map(shape, [used] * 4, timeout=SECONDS)) == [(20, 18, 22)] * 4
    with fork.Pool(2) as pool:
        assert pool.map_async(shape, [wavesplat.open(path)] * 4).get(SECONDS) == [(20, 18, 22)] * 4


FRESH = """
    import os, sys
    sys.path.insert(0, sys.argv[1])
    import numpy as np, wavesplat
    array = np.random.default_rng(0).random((8, 20, 18, 22)).astype("f4")
    child = os.fork()
    if child == 0:
        wavesplat.convert(array, "a.wspl")
        os._exit(0 if wavesplat.open("a.wspl")[...].shape == array.shape else 1)
    sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_a_process_that_is_forked_before_any_use_converts(tmp_path):
    (tmp_path / "work.py").write_text(textwrap.dedent(FRESH))
    folder = os.path.dirname(os.path.dirname(wavesplat.__file__))
    subprocess.run([sys.executable, "work.py", folder], cwd=tmp_path, check=True, timeout=SECONDS)
