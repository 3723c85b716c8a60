"""Pictures, figures and the viewer."""

import os
import re
import signal
import subprocess
import sys
import textwrap
import urllib.error
import urllib.request

import numpy as np
import pytest
from conftest import run

import wavesplat


def test_pictures_are_those_of_the_program(tmp_path, path, file):
    cases = [
        ({"frames": slice(2, 9, 3), "size": (60, 40)}, "--frames 2:9:3 --size 60x40"),
        (
            {"frames": [1, 7], "mode": "mip", "view": (200.5, -10), "size": (50, 50)},
            "--frames 1,7 --mode mip --view=200.5,-10 --size 50x50",
        ),
        (
            {"frames": 3, "colormap": "turbo", "range": (-1, 2.5), "size": (32, 32)},
            "--frames 3 --colormap turbo --range=-1,2.5 --size 32x32",
        ),
        ({"frames": 3, "slice": {"z": "50%"}, "size": (32, 32)}, "--frames 3 --slice z=0.5 --size 32x32"),
        (
            {"frames": 3, "mode": "composite", "shade": True, "size": (32, 32)},
            "--frames 3 --mode composite --shade --size 32x32",
        ),
        ({"frames": 3, "view": [(0, 0), "top"], "size": (32, 32)}, "--frames 3 --view 0,0 --view top --size 32x32"),
    ]
    for n, (options, words) in enumerate(cases):
        out = tmp_path / f"{n}.npy"
        run(path, *words.split(), "-q", "-o", out, name="wavesplat-render")
        pictures = file.render(**options)
        np.testing.assert_array_equal(pictures, np.load(out).reshape(pictures.shape))


def test_maps_of_matplotlib(file):
    matplotlib = pytest.importorskip("matplotlib")
    options = {"frames": 3, "size": (48, 48), "range": (-2, 2), "clear": "none", "beyond": "none"}
    by_name, by_object = (file.render(colormap=map, **options) for map in ("RdBu", matplotlib.colormaps["RdBu"]))
    np.testing.assert_array_equal(by_name, by_object)
    values = file.render(**{key: options[key] for key in ("frames", "size")})[0]
    expected = matplotlib.colormaps["RdBu"](np.clip((values + 2) / 4, 0, 1))[..., :3] * 255
    inside = np.isfinite(values)
    assert abs(by_name[0][inside] - expected[inside]).max() <= 4  # it has steps, and these are interpolated


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"nonsense": 1}, "nonsense"),
        ({"frames": 99}, "frames are numbered 0 to 39"),
        ({"size": "large"}, "size"),
        ({"colormap": "nothing"}, "no such colour map"),
        ({"mode": "composite", "colormap": "turbo"}, "transfer_function"),
    ],
)
def test_wrong_options(file, options, words):
    with pytest.raises(ValueError, match=words) as raised:
        file.render(**options)
    assert "--" not in str(raised.value)


def test_figures(tmp_path, file):
    png = file.figure("png", size=(200, 150))
    assert png.data.startswith(b"\x89PNG")
    assert png._repr_png_() == png.data
    page = file.figure(size=(100, 80), frames=slice(0, 3))
    assert "<iframe srcdoc=" in page._repr_html_()
    assert "sandbox" in page._repr_html_()
    whole = file.figure(interactive=True, mode="mip")
    assert b'id="program"' in whole.data
    assert "iframe" in whole._repr_html_()
    with pytest.raises(ValueError, match="interactive"):
        file.figure("png", interactive=True)
    assert b"acTL" in file.figure("apng", frames=slice(0, 2), size=(80, 60)).data
    for several in ({"frames": [1, 2]}, {"frames": 1, "view": [(30, 30), "top"]}):
        assert file.figure("png", size=(80, 60), iso=[0.5, 1.5], **several).data.startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="not both"):
        file.figure("png", frames=[1, 2], view=["top", "front"])
    assert page.save(tmp_path / "a.html").read_bytes() == page.data
    with pytest.raises(ValueError, match="format"):
        file.figure("bmp")


@pytest.mark.parametrize("options", [{"port": 99999}, {"port": -1}])
def test_wrong_ports(file, options):
    with pytest.raises(ValueError, match="port"):
        file.view(browser=False, **options)


def test_the_viewer_answers_until_it_is_closed(file):
    with file.view(browser=False) as viewer:
        with urllib.request.urlopen(viewer.address) as answer:
            assert answer.status == 200
            assert b"<canvas" in answer.read()
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(viewer.address[:-3])
        assert viewer.address in viewer._repr_html_()
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(viewer.address)


LONG = """
    import signal
    import wavesplat
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it
    def report(done, steps):
        print("began", flush=True)
    wavesplat.open("{path}").render(mode="composite", size=(1500, 1500), slices=8, progress=report)
"""


def test_long_rendering_can_be_interrupted(path, tmp_path):
    code = textwrap.dedent(LONG.format(path=path))
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "began\n"
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in errors


def test_napari_gets_a_dask_array(path, decoded):
    from wavesplat.napari import get_reader

    ((samples, settings, kind),) = get_reader([str(path)])([str(path)])
    assert kind == "image"
    assert len(samples) == wavesplat.open(path).coarsest + 1
    assert samples[0].chunks == wavesplat.open(path).chunks
    for lod, level in enumerate(samples):
        np.testing.assert_array_equal(level.compute(), decoded[:, :: 2**lod, :: 2**lod, :: 2**lod])
    assert settings["multiscale"] == (len(samples) > 1)
    assert len(settings["scale"]) == 4
    assert get_reader("a.png") is None


def test_numbers_of_slices_are_coordinates(file, decoded):
    size = {"frames": 3, "size": (64, 64)}
    np.testing.assert_array_equal(file.render(slice={"z": 1.0}, **size), file.render(slice={"z": "#1"}, **size))
    np.testing.assert_array_equal(file.render(slice={"z": 1}, **size), file.render(slice="z=#1", **size))


def test_frames_by_masks_and_views_by_lists(file):
    mask = np.arange(40) == 7
    np.testing.assert_array_equal(file.render(frames=mask, size=(20, 20)), file.render(frames=7, size=(20, 20)))
    with pytest.raises(ValueError, match="frames: none"):
        file.render(frames=mask & False)
    several = file.render(view=[(30, 30), "top"], frames=[1, 2, 3], size=(20, 24))
    assert several.shape == (2, 3, 24, 20)
    assert file.render(orbit=4, frames=0, size=(20, 24)).shape == (4, 1, 24, 20)


def test_every_option_of_pictures_has_a_type():
    found, heading = set(), ""
    for line in run("--help", name="wavesplat-render").splitlines():
        heading = line.rstrip(":") if re.fullmatch(r"\w[\w ]*:", line) else heading
        option = re.match(r"\s+(?:-\w, )?--([a-z-]+)", line)
        if option and heading not in ("Options", "Parts", "Remote files", "Examples"):
            found.add((heading, option[1].replace("-", "_")))
    typed = wavesplat.PictureOptions.__optional_keys__
    assert typed <= {name for _, name in found}
    of_inputs = {name for heading, name in found if heading in ("Input", "Common options")}
    assert {name for _, name in found} - typed - of_inputs == {"output", "force", "format"}
