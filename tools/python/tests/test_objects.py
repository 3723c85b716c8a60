"""Files in file objects: of fsspec, of Python, and such as fail."""

import gzip
import io
import mmap
import multiprocessing
import pickle
import subprocess
import sys
import tarfile
import zipfile
from concurrent.futures import ThreadPoolExecutor

import fsspec.asyn
import fsspec.spec
import numpy as np
import pytest
import xarray as xr

import wavesplat
import wavesplat.xarray


@pytest.fixture
def memory(path):
    """The address of the file in fsspec's memory."""
    fsspec.filesystem("memory").pipe("/runs/run.wspl", path.read_bytes())
    return "memory://runs/run.wspl"


def _mapped(path):
    with open(path, "rb") as opened:
        return mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)


def test_objects_give_the_samples_of_the_path(path, memory, decoded, tmp_path):
    packed = tmp_path / "run.wspl.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    with zipfile.ZipFile(tmp_path / "runs.zip", "w") as archive:
        archive.write(path, "a/run.wspl")
    with tarfile.open(tmp_path / "runs.tar", "w") as archive:
        archive.add(path, "run.wspl")
    for place in (
        io.BytesIO(path.read_bytes()),
        open(path, "rb"),
        open(path, "rb", buffering=0),
        gzip.open(packed),
        fsspec.open(memory),
        fsspec.open(memory).open(),
        fsspec.open(str(path)).open(),
        fsspec.open(f"simplecache::{memory}"),
        fsspec.open(str(packed), compression="gzip"),
        fsspec.open(f"zip://a/run.wspl::{tmp_path}/runs.zip", skip_instance_cache=True),
        tarfile.open(tmp_path / "runs.tar").extractfile("run.wspl"),
        _mapped(path),
    ):
        with wavesplat.open(place) as file:
            assert np.array_equal(file[5:20, 3, ::2], decoded[5:20, 3, ::2]), place
            assert np.array_equal(file[...], decoded), place
    with wavesplat.open(fsspec.open(memory), lod=1) as coarse:
        assert np.array_equal(coarse[3], wavesplat.open(path, lod=1)[3])
        assert coarse.path.endswith("runs/run.wspl")


class Server(fsspec.asyn.AsyncFileSystem):
    """Files whose ranges are asked for side by side, as of a server."""

    cachable = False

    def __init__(self, files):
        super().__init__()
        self.files, self.asked = files, 0

    async def _info(self, path, **options):
        return {"name": path, "size": len(self.files[path]), "type": "file"}

    async def _cat_file(self, path, start=None, end=None, **options):
        if self.asked > 5:
            raise ConnectionResetError("the line is cut")
        return self.files[path][start:end]

    def cat_ranges(self, *given, **options):
        self.asked += 1
        return super().cat_ranges(*given, **options)

    def _open(self, path, mode="rb", **options):
        return fsspec.spec.AbstractBufferedFile(self, path, mode)


def test_servers_are_asked_for_ranges_together(path, decoded):
    server = Server({"run.wspl": path.read_bytes()})
    assert np.array_equal(wavesplat.open(server.open("run.wspl"))[...], decoded)
    assert 0 < server.asked < 6
    packed = fsspec.core.OpenFile(
        Server({"run.wspl": gzip.compress(path.read_bytes())}), "run.wspl", compression="gzip"
    )
    assert np.array_equal(wavesplat.open(packed)[3], decoded[3])
    server.asked = 6
    with pytest.raises(ConnectionResetError, match="cut"):
        wavesplat.open(server.open("run.wspl"))


def test_an_open_file_is_that_file(path, decoded, tmp_path, monkeypatch):
    """Not another one that has its name by now."""
    monkeypatch.chdir(path.parent)
    with open(path.name, "rb") as opened:
        (tmp_path / path.name).write_bytes(b"another one")
        monkeypatch.chdir(tmp_path)
        assert np.array_equal(wavesplat.open(opened)[2], decoded[2])


def test_threads_that_read_end_with_the_interpreter(path):
    script = f"""if True:
        import io, threading, time, wavesplat
        class Slow(io.BytesIO):
            def read(self, count=-1):
                time.sleep(0.001)
                return super().read(count)
        file = wavesplat.open(Slow(open({str(path)!r}, "rb").read()), cache=0)
        def loop():
            while True: file.read(3, memory=1 << 20)
        for _ in range(4): threading.Thread(target=loop, daemon=True).start()
        time.sleep(0.05)
    """
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_threads_share_an_object(path, decoded):
    file = wavesplat.open(io.BytesIO(path.read_bytes()), cache=0)
    with ThreadPoolExecutor(8) as threads:
        frames = list(threads.map(lambda n: file[n % 40, n % 20], range(200)))
    assert all(np.array_equal(found, decoded[n % 40, n % 20]) for n, found in enumerate(frames))


def test_descriptions_and_pictures_of_an_object(tmp_path):
    samples = np.random.default_rng(0).random((4, 8, 8, 8))
    ds = xr.Dataset({"u": (("time", "z", "y", "x"), samples)}, {"x": np.arange(8.0) ** 2})
    ds.to_wavesplat(tmp_path / "u.wspl", tolerance=0)
    stored = (tmp_path / "u.wspl").read_bytes()
    with xr.open_dataset(io.BytesIO(stored), engine="wavesplat") as found:
        assert np.array_equal(found.u, ds.u)
        assert np.array_equal(found.x, ds.x)
    options = {"size": (32, 32), "frames": 2, "view": (30, 30)}
    drawn = wavesplat.open(io.BytesIO(stored)).render(**options)
    assert np.array_equal(drawn[0], wavesplat.open(tmp_path / "u.wspl").render(**options)[0], equal_nan=True)


def test_objects_are_pickled_if_they_can_be(path, memory, decoded):
    for place in fsspec.open(memory), fsspec.open(memory).open(), io.BytesIO(path.read_bytes()):
        again = pickle.loads(pickle.dumps(wavesplat.open(place)))
        assert np.array_equal(again[7], decoded[7])
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(wavesplat.open(open(path, "rb", buffering=0)))


def test_what_cannot_be_read_is_said(path, tmp_path):
    class Unseekable(io.RawIOBase):
        def readable(self):
            return True

        def readinto(self, room):
            return 0

    class Failing(io.BytesIO):
        def read(self, count=-1):
            if count:
                raise ConnectionResetError("the line is cut")
            return super().read(count)

    class Short(io.BytesIO):
        def read(self, count=-1):
            return super().read(count // 2) if self.tell() == 0 else b""

    stored = path.read_bytes()
    for place, exception, words in (
        (Unseekable(), ValueError, "cannot seek"),
        (open(path), TypeError, "mode 'rb'"),
        (3, TypeError, "file object"),
        ("memory://run.wspl", ValueError, "give fsspec.open"),
        (io.BytesIO(b"no coefficients"), wavesplat.DamagedError, "coefficient file"),
        (io.BytesIO(stored[:-1]), wavesplat.DamagedError, "damaged|truncated|cut"),
        (Short(stored), OSError, "other numbers of bytes"),
        (Failing(stored), ConnectionResetError, "the line is cut"),
    ):
        with pytest.raises(exception, match=words):
            wavesplat.open(place)
    with pytest.raises(ValueError, match="cache_dir"):
        wavesplat.open(io.BytesIO(stored), cache_dir=tmp_path)
    closed = io.BytesIO(stored)
    file = wavesplat.open(closed, cache=0)
    closed.close()
    with pytest.raises(ValueError, match="closed file"):
        file[...]
    opened = wavesplat.open(fsspec.open(str(path), compression="infer"))
    assert opened._object is None, "a file of this machine is mapped"
    (tmp_path / "run.gz").write_bytes(gzip.compress(stored))
    opened = wavesplat.open(fsspec.open(str(tmp_path / "run.gz"), compression="gzip"))
    inner = opened._object.file
    opened.close()
    assert inner.closed


def _read(file, out):
    try:
        out.put(file[0, 0, 0, 0])
    except RuntimeError as error:
        out.put(str(error))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="processes are not forked here")
def test_a_forked_process_opens_objects_again(path):
    context = multiprocessing.get_context("fork")
    file, out = wavesplat.open(io.BytesIO(path.read_bytes())), context.Queue()
    child = context.Process(target=_read, args=(file, out))
    child.start()
    assert "another process" in out.get(timeout=30)
    child.join()
