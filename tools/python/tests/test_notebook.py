"""The example runs in Jupyter, and its picture is there to see."""

import shutil
import subprocess
from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")
image = pytest.importorskip("matplotlib.image")

EXAMPLE = Path(__file__).parent.parent / "examples" / "from_xarray.ipynb"
FLAGS = "--headless=new --no-sandbox --disable-gpu --no-proxy-server --hide-scrollbars --virtual-time-budget=8000"
FLAGS += " --disable-features=IsolateSandboxedIframes"  # whose pictures a screenshot does not wait for


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(EXAMPLE, 4)
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(folder)}}).execute()
    return folder, [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_the_example_is_short_and_runs(executed):
    folder, cells = executed
    lines = [line for cell in cells for line in cell.source.splitlines() if line.strip()]
    assert len(lines) < 20
    assert (folder / "density.wspl").exists()
    assert [output.output_type for cell in cells for output in cell.outputs] == ["execute_result"] * 3, "no warnings"
    assert "times smaller" in cells[2].outputs[0].data["text/plain"]


def test_its_picture_is_seen(executed):
    """A browser shows the volume in colours, on the dark background of the page."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("chromium is not installed")
    folder, cells = executed
    (folder / "page.html").write_text("<!doctype html>" + cells[-1].outputs[0].data["text/html"])
    words = [chromium, *FLAGS.split(), f"--user-data-dir={folder}/profile", "--window-size=800,600"]
    shot = folder / "shot.png"
    subprocess.run(
        [*words, f"--screenshot={shot}", f"file://{folder}/page.html"], check=True, capture_output=True, timeout=100
    )
    pixels = image.imread(shot)[..., :3]
    colourful = (pixels.max(-1) - pixels.min(-1)) > 0.2
    assert colourful.mean() > 0.002, "nothing in colours"
    assert len({tuple(pixel) for pixel in (pixels[colourful] * 15).astype(int)}) > 20, "no shades"
