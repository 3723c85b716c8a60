"""Builds the package by maturin, which would download Rust where it is missing: says so instead."""

import shutil

from maturin import *  # noqa: F403
from maturin import get_requires_for_build_editable as _for_editable
from maturin import get_requires_for_build_wheel as _for_wheel


def _need_rust() -> None:
    if shutil.which("cargo") is None:
        raise SystemExit("wavesplat: to build this package, install Rust (https://rustup.rs) and a C compiler")


def get_requires_for_build_wheel(config_settings=None):
    """Requirements of a wheel."""
    _need_rust()
    return _for_wheel(config_settings)


def get_requires_for_build_editable(config_settings=None):
    """Requirements of an editable installation."""
    _need_rust()
    return _for_editable(config_settings)
