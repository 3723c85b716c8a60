"""Workers of Dask read files and convert parts."""

import os
import signal
import threading
import time

import numpy as np
import pytest
import xarray as xr
from conftest import smooth

import wavesplat
import wavesplat.dask
import wavesplat.xarray

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def client():
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client:
        yield client


def test_workers_read(client, path, decoded):
    ds = xr.open_dataset(path, chunks={})
    mean = ds.data.mean(("z", "y", "x")).compute()
    np.testing.assert_allclose(mean, decoded.mean((1, 2, 3)), rtol=1e-4, atol=1e-5)
    series = client.gather(client.map(lambda n, file: file[:, n, 3, 4], range(8), file=wavesplat.open(path)))
    np.testing.assert_array_equal(series, decoded[:, :8, 3, 4].T)


def test_workers_compute_what_is_converted(client, tmp_path):
    samples = smooth((24, 12, 12, 12))
    lazy = xr.DataArray(samples, dims=("time", "z", "y", "x"), name="u").chunk({"time": 6, "x": 5}) * 1.0
    lazy.to_wavesplat(tmp_path / "a.wspl", tolerance=0)
    np.testing.assert_array_equal(wavesplat.open(tmp_path / "a.wspl")[...], samples)


def test_workers_convert(client, tmp_path):
    def part(n, folder):
        wavesplat.convert(smooth((16, 10, 10, 10), seed=n), f"{folder}/{n}.wspl", range=(-4, 4))
        return wavesplat.open(f"{folder}/{n}.wspl").shape

    assert client.gather(client.map(part, range(4), folder=str(tmp_path))) == [(16, 10, 10, 10)] * 4


def test_many_workers_make_the_file_of_one_conversion(client, tmp_path):
    samples = smooth((64, 12, 12, 12))
    lazy = xr.DataArray(samples, dims=("time", "z", "y", "x"), name="u").chunk({"time": 5}) * 1.0
    settings = {"tolerance": 1e-3, "window": 8, "chain": 2}
    (tmp_path / "a.wspl").write_text("mine")
    with pytest.raises(ValueError, match="exists already"):
        wavesplat.dask.convert(lazy, tmp_path / "a.wspl", client=client, **settings)
    report = wavesplat.dask.convert(lazy, tmp_path / "a.wspl", client=client, overwrite=True, **settings)
    assert report["shards"] == 4
    whole = (float(samples.min()), float(samples.max()))
    wavesplat.convert(lazy, tmp_path / "b.wspl", range=whole, **settings)
    assert (tmp_path / "a.wspl").read_bytes() == (tmp_path / "b.wspl").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.wspl", "b.wspl"]


def test_shards_of_other_frames_are_not_taken(client, tmp_path):
    """What an earlier run left is made anew with overwrite."""
    first, second = (samples_of(smooth((32, 8, 8, 8), seed=n)).chunk({"time": 8}) for n in (1, 2))
    settings = {"window": 8, "chain": 1, "range": (-4, 4), "client": client}
    folder = tmp_path / "a.wspl.shards"
    folder.mkdir()
    wavesplat.convert(first, folder / "part-1-of-4.wspl", shard=(1, 4), window=8, chain=1, range=(-4, 4))
    wavesplat.dask.convert(second, tmp_path / "a.wspl", shards=4, overwrite=True, **settings)
    assert abs(wavesplat.open(tmp_path / "a.wspl")[...] - second.values).max() <= 0.08
    assert not folder.exists()
    with pytest.raises(ValueError, match="Dask arrays"):
        wavesplat.dask.convert(first.compute(), tmp_path / "b.wspl", **settings)


def test_a_worker_that_is_killed_is_made_up_for(tmp_path):
    """Its shards are converted by the other worker, and the file is the same."""
    samples = smooth((64, 24, 24, 24))
    lazy = xr.DataArray(samples, dims=("time", "z", "y", "x"), name="u").chunk({"time": 4}).map_blocks(slowly)
    settings = {"window": 8, "chain": 1, "range": (-4, 4)}
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client:
        first = next(iter(cluster.workers.values()))
        killer = threading.Timer(1.0, lambda: os.kill(first.process.pid, signal.SIGKILL))
        killer.start()
        wavesplat.dask.convert(lazy, tmp_path / "a.wspl", client=client, **settings)
        killer.join()
    wavesplat.convert(samples_of(samples), tmp_path / "b.wspl", **settings)
    assert (tmp_path / "a.wspl").read_bytes() == (tmp_path / "b.wspl").read_bytes()


def slowly(block):
    time.sleep(0.2)
    return block


def samples_of(samples):
    return xr.DataArray(samples, dims=("time", "z", "y", "x"), name="u")


def test_wrong_shards(tmp_path):
    array = samples_of(smooth((64, 4, 4, 4)))
    with pytest.raises(ValueError, match="needs range"):
        wavesplat.convert(array, tmp_path / "a.wspl", shard=(1, 2))
    with pytest.raises(ValueError, match="shard: takes"):
        wavesplat.convert(array, tmp_path / "a.wspl", shard=(3, 2), range=(-4, 4))
    wavesplat.convert(array, tmp_path / "a.wspl", shard=(1, 2), range=(-4, 4), chain=1)
    with pytest.raises(ValueError, match="shard 2 of 2 is missing"):
        wavesplat.merge([tmp_path / "a.wspl"], tmp_path / "b.wspl")
