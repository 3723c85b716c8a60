"""Pictures that notebooks show."""

from __future__ import annotations

import html
from os import PathLike
from pathlib import Path

_KINDS = {"png": "image/png", "apng": "image/png", "gif": "image/gif", "html": "text/html"}


class Figure:
    """A picture, a moving picture or an interactive page, as the bytes of a file.

    Attributes:
        data: The bytes.
        format: "png", "apng", "gif" or "html".
        height: Pixels of height that a page takes in a notebook.

    """

    def __init__(self, data: bytes, format: str, height: int = 700) -> None:
        """A figure of the bytes of a file."""
        self.data, self.format, self.height = data, format, height

    def save(self, path: str | PathLike[str]) -> Path:
        """Writes the figure to a file."""
        path = Path(path)
        path.write_bytes(self.data)
        return path

    def __repr__(self) -> str:  # noqa: D105
        return f"<wavesplat.Figure: {self.format}, {len(self.data)} bytes>"

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str | bytes]:
        if self.format != "html":
            return {"text/plain": repr(self), _KINDS[self.format]: self.data}
        page = html.escape(self.data.decode())
        frame = (
            f'<iframe srcdoc="{page}" width="100%" height="{self.height}" style="border: 0" '
            'sandbox="allow-scripts allow-downloads"></iframe>'
        )
        return {"text/plain": repr(self), "text/html": frame}

    def _repr_html_(self) -> str | None:
        return str(self._repr_mimebundle_()["text/html"]) if self.format == "html" else None

    def _repr_png_(self) -> bytes | None:
        return self.data if self.format in ("png", "apng") else None
