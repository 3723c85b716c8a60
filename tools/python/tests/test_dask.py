"""Workers of Dask read files and convert parts."""

import numpy as np
import pytest
import xarray as xr
from conftest import smooth

import wavesplat
import wavesplat.xarray  # noqa: F401

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
