"""The part of the package's build that pyproject.toml cannot say: the extension, and the version, which is the library's."""
import subprocess

from setuptools import setup


def version():
    """That of the librextract that pkg-config finds; the wheel is for it alone."""
    try:
        return subprocess.run(["pkg-config", "--modversion", "librextract"], check=True, text=True,
                              stdout=subprocess.PIPE).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        raise SystemExit("librextract is not found by pkg-config; install it (make install), and set PKG_CONFIG_PATH to "
                         "PREFIX/lib/pkgconfig where PREFIX is not searched")


setup(version=version(), cffi_modules=["build_extension.py:builder"], options={"bdist_wheel": {"py_limited_api": "cp39"}})
