"""The interactive viewer of a file."""

from __future__ import annotations

from . import _wavesplat


class Viewer:
    """The viewer of a file, a server on this machine. It answers until it is closed, or this object is gone."""

    def __init__(self, viewer: _wavesplat.Viewer, *, browser: bool) -> None:
        """Of a server that answers."""
        self._viewer = viewer
        if browser:
            self._viewer.open_browser()

    @property
    def address(self) -> str:
        """The address of the page. It holds a token: only who knows it can look."""
        return self._viewer.address

    def close(self) -> None:
        """Ends the server."""
        self._viewer.close()

    def __enter__(self) -> Viewer:  # noqa: D105
        return self

    def __exit__(self, *raised: object) -> None:  # noqa: D105
        self.close()

    def __repr__(self) -> str:  # noqa: D105
        return f"<wavesplat.Viewer {self.address}>"

    def _repr_html_(self) -> str:
        return f'<a href="{self.address}" target="_blank">{self.address}</a>'
