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
    wavesplat.convert(array, tmp_path / "a.wspl", shard=(1, 2), range=(-4, 4), chain=1, window=32)
    with pytest.raises(ValueError, match="shard 2 of 2 is missing"):
        wavesplat.merge([tmp_path / "a.wspl"], tmp_path / "b.wspl")


VIEWS = {"view": [(30, 30), (75.5, -20)], "size": (48, 40)}


@pytest.mark.parametrize(
    "options",
    [
        {"frames": slice(2, 30, 5), **VIEWS},
        {"frames": slice(2, 30, 5), "colormap": "turbo", **VIEWS},
        {"mode": "composite", "frames": [3, 20], **VIEWS},
        {"orbit": 3, "frames": slice(0, 20, 6), "size": (40, 30)},
        {"orbit": 8, "over_time": True, "size": (40, 30)},
        {"frames": 9, "quantity": "emission", "size": (40, 30)},
    ],
)
def test_many_workers_render_the_pictures_of_one_call(client, rendered, options):
    path, _ = rendered
    np.testing.assert_array_equal(
        wavesplat.dask.render(path, client=client, **options), wavesplat.open(path).render(**options)
    )


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """A file, and its two shards."""
    folder = tmp_path_factory.mktemp("rendered")
    samples, settings = samples_of(smooth((32, 20, 22, 24))), {"window": 8, "chain": 1, "range": (-4, 4), "block": 8}
    wavesplat.convert(samples, folder / "a.wspl", **settings)
    shards = [folder / f"{n}.wspl" for n in (1, 2)]
    for n, shard in enumerate(shards, 1):
        wavesplat.convert(samples, shard, shard=(n, 2), **settings)
    return folder / "a.wspl", shards


def test_parts_by_many_workers_add_up(client, rendered):
    """Slabs of a file differ by rounding from one rendering; shards do not."""
    path, shards = rendered
    options = {"frames": [1, 9, 30], **VIEWS}
    one = wavesplat.open(path).render(**options)
    np.testing.assert_array_equal(wavesplat.dask.render(shards[::-1], client=client, **options), one)
    for source, regions in [(path, 3), (path, ["0:11,:,:", "11:,:,:"]), (shards, 3), (shards, [":,:,:"])]:
        parts = wavesplat.dask.render(source, client=client, regions=regions, **options)
        np.testing.assert_allclose(parts, one, rtol=0, atol=2e-6 * np.nanmax(abs(one)))
    deep = [f"{x}:{x + 2},:,:" for x in range(0, 24, 2)]  # more than one task adds
    parts = wavesplat.dask.render(path, client=client, regions=deep, quantity="emission", **options)
    whole = wavesplat.open(path).render(quantity="emission", **options)
    np.testing.assert_allclose(parts, whole, rtol=0, atol=2e-6 * np.nanmax(abs(whole)))
    coloured = {"colormap": "turbo", "range": (-1, 1), **options}
    np.testing.assert_array_equal(
        wavesplat.dask.render(shards, client=client, **coloured), wavesplat.open(path).render(**coloured)
    )
    assert sorted(each.name for each in path.parent.iterdir()) == ["1.wspl", "2.wspl", "a.wspl"]


def test_pictures_that_are_no_sums_are_refused(client, rendered):
    path, shards = rendered
    for options, words in [
        ({"mode": "mip", "regions": 2}, "largest values along rays are no sums"),
        ({"regions": 99}, "regions: takes 1 to 3"),
        ({"regions": 2, "region": "0:2,:,:"}, "region: cannot be given"),
        ({"regions": ["0:5,:,:", "4:,:,:"]}, "shares voxels"),
        ({"frames": []}, "frames: none"),
    ]:
        with pytest.raises(ValueError, match=words):
            wavesplat.dask.render(path, client=client, **options)
    with pytest.raises(ValueError, match="source"):
        wavesplat.dask.render([], client=client)
    assert not [each for each in path.parent.iterdir() if each.suffix == ".parts"]
