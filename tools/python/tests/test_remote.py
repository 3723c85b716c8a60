"""Files on servers: of HTTP, and of an S3 store as moto makes it."""

import io
import pickle
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import run
from matplotlib.image import imread

import wavesplat

boto3 = pytest.importorskip("boto3")
moto = pytest.importorskip("moto.server")


class Handler(BaseHTTPRequestHandler):
    """Serves ranges of the files of a folder, and remembers them."""

    protocol_version = "HTTP/1.1"

    def do_GET(self):
        path = Path(self.server.folder, self.path.lstrip("/"))
        if not path.is_file():
            self.send_response(404)
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        data = path.read_bytes()
        first, last = map(int, re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        last = min(last, len(data) - 1)
        self.server.ranges.append((first, last))
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {first}-{last}/{len(data)}")
        self.send_header("Content-Length", str(last + 1 - first))
        self.send_header("ETag", f'"{hash(data)}"')
        self.end_headers()
        self.wfile.write(data[first : last + 1])

    def log_message(self, *args):
        pass


@pytest.fixture
def server(path):
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.folder, server.ranges = path.parent, []
        server.url = f"http://127.0.0.1:{server.server_port}/{path.name}"
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture
def bucket(path, monkeypatch):
    """The address of the file in an S3 store, with the credentials to read it."""
    store = moto.ThreadedMotoServer(port=0)
    store.start()
    host, port = store.get_host_and_port()
    endpoint = f"http://127.0.0.1:{port}"
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "key")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    client = boto3.client("s3", region_name="us-east-1", endpoint_url=endpoint)
    client.create_bucket(Bucket="lab")
    client.upload_file(str(path), "lab", "my runs/run.wspl")
    yield "s3://lab/my runs/run.wspl"
    store.stop()


def test_samples_are_those_of_a_local_file(server, decoded):
    file = wavesplat.open(server.url)
    assert len(server.ranges) <= 2
    np.testing.assert_array_equal(file[...], decoded)
    np.testing.assert_array_equal(file[3:9, 5, ::2, 7], decoded[3:9, 5, ::2, 7])
    assert server.url in repr(file)


def test_xarray_opens_an_address(server, path):
    with xr.open_dataset(server.url, engine="wavesplat") as far, xr.open_dataset(path) as near:
        xr.testing.assert_identical(far.load(), near.load())


def test_other_processes_reopen_an_address(server, decoded):
    file = pickle.loads(pickle.dumps(wavesplat.open(server.url)))
    np.testing.assert_array_equal(file[7], decoded[7])


def test_a_cache_saves_requests(server, tmp_path, decoded):
    wavesplat.open(server.url, cache_dir=tmp_path)[...]
    server.ranges.clear()
    np.testing.assert_array_equal(wavesplat.open(server.url, cache_dir=tmp_path)[...], decoded)
    assert len(server.ranges) == 1


def test_what_is_not_there_is_not_found(server):
    with pytest.raises(FileNotFoundError, match="no such file"):
        wavesplat.open(server.url + ".gone")


def test_pictures_of_an_address(server, path):
    def picture(place):
        return imread(io.BytesIO(wavesplat.open(place).figure("png", frames=3, size=(40, 30)).data))

    np.testing.assert_array_equal(picture(server.url), picture(path))


def test_an_object_of_s3_is_read_and_verified(bucket, decoded):
    np.testing.assert_array_equal(wavesplat.open(bucket)[...], decoded)
    assert "whole" in run("verify", bucket)


def test_an_object_that_is_not_there_is_named(bucket):
    with pytest.raises(FileNotFoundError, match=r"gone\.wspl.*404"):
        wavesplat.open("s3://lab/gone.wspl")
